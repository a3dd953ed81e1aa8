"""Random damage: how many markers are wrong, and whose images they are in, over as many seeds as asked for.

    python -m benchmarks.damage [--images N] [--seed S] [--json FILE]
    python -m benchmarks.damage --only "random blobs/round/5017" --save DIR     one image, read alone, and its overlay

Scratches, drops, reflections and missing cells of any color, size and number, on surfaces pressed, twisted, sheared and
tilted, under light of any color. Fresh seeds are images that no rule of the extractor has been tuned on.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scoring.reading import Result, notable_lines, overlay, read, warm_up, wrong_in
from benchmarks.suites.scoring.report import one_line
from benchmarks.suites.stress.drawn import DRAWN
from benchmarks.suites.stress.frames import PATTERNS, Shot
from benchmarks.suites.stress.kinds import Case
from extractor import Markers

IMAGES, SEED = 2100, 5000


@dataclass(frozen=True)
class Read:
    """One image.

    Attributes:
        others: of the wrong markers those that lie nearer to another one's true place than to their own.
    """

    result: Result
    others: int


@dataclass(frozen=True)
class Total:
    """All images of one kind. Counts are of markers; unread are images that nothing was read in.

    Attributes:
        lost: visible and not reported.
        sure, kept: see the suite's ``Score``; only of images in which something was read.
        seeds: names of the images with wrong markers, and how many.
    """

    kind: str
    images: int
    unread: int
    raised: int
    visible: int
    reported: int
    wrong: int
    others: int
    lost: int
    sure: int
    kept: int
    seeds: tuple[tuple[str, int], ...]


def drawn(images: int, seed: int) -> list[Case]:
    """The kinds in turn, each in all patterns; every image has a seed of its own, from ``seed`` on."""
    kinds = [kind.name for kind in DRAWN]
    return [
        Case(kinds[n % len(kinds)], 0, PATTERNS[n // len(kinds) % len(PATTERNS)], seed + n)
        for n in range(images)
    ]


def name_of(case: Case) -> str:
    return f"{case.kind}/{case.pattern}/{case.seed}"


def case_of(name: str) -> Case:
    """Raises ``ValueError`` where no image is named so."""
    kind, _, rest = name.partition("/")
    pattern, _, seed = rest.partition("/")
    if kind not in {one.name for one in DRAWN} or pattern not in PATTERNS or not seed.isdigit():
        raise ValueError(f"no image is named {name!r}; give one as '{DRAWN[0].name}/{PATTERNS[0]}/{SEED}'")
    return Case(kind, 0, pattern, int(seed))


def taken_for_others(shot: Shot, markers: Markers) -> int:
    """How many wrong markers lie nearer to another one's true place than to their own."""
    wrong, truth = wrong_in(shot, markers)
    places: NDArray[np.float64] = truth.marker_xy_px
    apart = np.linalg.norm(markers.xy_px[wrong][:, None] - places, axis=2)
    return int((apart.argmin(axis=1) != np.flatnonzero(wrong)).sum()) if wrong.any() else 0


def _job(case: Case) -> Read:
    result, shot, markers = read(case, 1, timing=False)
    return Read(result, taken_for_others(shot, markers) if markers is not None and result.score.wrong else 0)


def run(chosen: list[Case], processes: int) -> Iterator[Read]:
    """Results as they come."""
    if processes == 1:
        warm_up()
        yield from map(_job, chosen)
        return
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        yield from pool.imap_unordered(_job, chosen, chunksize=4)


def with_progress(chosen: list[Case], processes: int) -> list[Read]:
    results, started = [], time.perf_counter()
    for one in run(chosen, processes):
        results.append(one)
        if sys.stderr.isatty() or len(results) % 200 == 0:
            text = f"{len(results)}/{len(chosen)} images, {time.perf_counter() - started:.0f} s"
            print(text, end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)
    return sorted(results, key=lambda one: one.result.case.seed)


def total_of(kind: str, own: Sequence[Read]) -> Total:
    results = [one.result for one in own]
    read_in = [one.score for one in results if not one.reason]
    scores = [one.score for one in results]
    return Total(
        kind=kind,
        images=len(results),
        unread=len(results) - len(read_in),
        raised=sum(one.raised for one in results),
        visible=sum(one.visible for one in scores),
        reported=sum(one.reported for one in scores),
        wrong=sum(one.wrong for one in scores),
        others=sum(one.others for one in own),
        lost=sum(one.lost for one in scores),
        sure=sum(one.sure for one in read_in),
        kept=sum(one.kept for one in read_in),
        seeds=tuple((name_of(one.case), one.score.wrong) for one in results if one.score.wrong),
    )


def totals(results: Sequence[Read]) -> list[Total]:
    """A row a kind, and one of all."""
    kinds = [kind.name for kind in DRAWN]
    rows = [total_of(kind, [one for one in results if one.result.case.kind == kind]) for kind in kinds]
    return [*(row for row in rows if row.images), total_of("together", results)]


HEAD = (
    f"{'kind':<24}{'images':>8}{'unread':>8}{'visible':>10}{'reported':>10}{'wrong':>7}{'ids':>6}{'lost':>9}"
    f"{'sure':>10}{'kept %':>9}"
)


def table(rows: Sequence[Total]) -> str:
    """As printed; ``ids`` are the wrong markers that lie where another one is."""
    lines = [HEAD]
    for row in rows:
        share = f"{100 * row.kept / row.sure:.2f}" if row.sure else "-"
        lines.append(
            f"{row.kind:<24}{row.images:>8}{row.unread:>8}{row.visible:>10}{row.reported:>10}{row.wrong:>7}"
            f"{row.others:>6}{row.lost:>9}{row.sure:>10}{share:>9}"
        )
    together = rows[-1]
    lines += [f"WRONG {count:>4}  {name}" for name, count in together.seeds]
    lines += [f"RAISED {together.raised} images"] * bool(together.raised)
    return "\n".join(lines)


def alone(case: Case, save: Path | None) -> Result:
    """Read one image here, print what is wrong in it, and write it with its overlay."""
    import cv2

    warm_up()
    result, shot, markers = read(case, 1, timing=False)
    print(one_line(result))
    for line in notable_lines(shot, markers):
        print(f"    {line}")
    if save is not None:
        save.mkdir(parents=True, exist_ok=True)
        stem = name_of(case).replace("/", "-").replace(" ", "_")
        cv2.imwrite(str(save / f"{stem}.png"), shot.image)
        if markers is not None:
            cv2.imwrite(str(save / f"{stem}.overlay.png"), overlay(shot, case, markers))
    return result


def write_json(rows: Sequence[Total], path: Path) -> None:
    beside = path.with_name(path.name + ".part")
    beside.write_text(json.dumps([row.__dict__ for row in rows], indent=1) + "\n", encoding="utf-8")
    beside.replace(path)


def main(arguments: list[str] | None = None) -> int:
    """Print a row a kind and the images with wrong markers; 1 when there is one, or an image raised."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.damage", description=__doc__.split("\n")[0])
    parser.add_argument("--images", type=int, default=IMAGES, metavar="N")
    parser.add_argument("--seed", type=int, default=SEED, metavar="S", help="of the first image")
    parser.add_argument("--only", metavar="NAME", help="one image: random blobs/round/5017")
    parser.add_argument("--save", type=Path, metavar="DIR", help="with --only: write image and overlay here")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    asked = parser.parse_args(arguments)
    if asked.only:
        try:
            result = alone(case_of(asked.only), asked.save)
        except ValueError as error:
            parser.error(str(error))
        return int(result.score.wrong > 0 or result.raised)
    started = time.perf_counter()
    rows = totals(with_progress(drawn(asked.images, asked.seed), asked.processes))
    print(table(rows))
    last = asked.seed + asked.images - 1
    print(f"{asked.images} images, seeds {asked.seed} to {last}; {time.perf_counter() - started:.0f} s")
    if asked.json:
        write_json(rows, asked.json)
    return int(any(row.wrong or row.raised for row in rows))


if __name__ == "__main__":
    sys.exit(main())
