"""Random damage: the number of wrong markers and their images, over any number of seeds.

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
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scoring.calibration import Calibration, calibration_head, calibration_line
from benchmarks.suites.scoring.reading import (
    CaseResult,
    draw_overlay,
    find_wrong_markers,
    notable_lines,
    read_case,
    warm_up,
)
from benchmarks.suites.scoring.report import result_line
from benchmarks.suites.scoring.squares import calibrations_by_position
from benchmarks.suites.stress.frames import PATTERNS, CaseImage
from benchmarks.suites.stress.kinds import StressCase
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from benchmarks.support.machine import null_for_nan
from cmpdesign.files.atomic import write_file
from extractor import Markers

IMAGES, SEED = 2100, 5000
NAME_WIDTH = 48  # of a kind and a status


@dataclass(frozen=True)
class DamageResult:
    """One image.

    Attributes:
        others: wrong markers that lie nearer to another marker's true position than to their own.
    """

    result: CaseResult
    others: int


@dataclass(frozen=True)
class DamageTotal:
    """All images of one kind. Counts are of markers; ``unread`` counts images without any marker.

    Attributes:
        lost: visible and not reported.
        sure, kept: see ``MarkerScore``; only of images with markers.
        seeds: names of the images with wrong markers, and the numbers of these.
        calibrations: errors over stated covariances, by how positions were found.
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
    calibrations: dict[str, Calibration]


def sample_cases(images: int, seed: int) -> list[StressCase]:
    """The kinds in turn, each in all patterns; every image has its own seed, from ``seed`` on."""
    kinds = [kind.name for kind in RANDOM_KINDS]
    return [
        StressCase(kinds[n % len(kinds)], 0, PATTERNS[n // len(kinds) % len(PATTERNS)], seed + n)
        for n in range(images)
    ]


def case_name(case: StressCase) -> str:
    """The name of an image, ``kind/pattern/seed``."""
    return f"{case.kind}/{case.pattern}/{case.seed}"


def parse_case(name: str) -> StressCase:
    """The case of a name of ``case_name``.

    Raises:
        ValueError: no image has this name.
    """
    kind, _, rest = name.partition("/")
    pattern, _, seed = rest.partition("/")
    if kind not in {entry.name for entry in RANDOM_KINDS} or pattern not in PATTERNS or not seed.isdigit():
        raise ValueError(
            f"no image is named {name!r}; give one as '{RANDOM_KINDS[0].name}/{PATTERNS[0]}/{SEED}'"
        )
    return StressCase(kind, 0, pattern, int(seed))


def count_swapped_markers(shot: CaseImage, markers: Markers) -> int:
    """The number of wrong markers that lie nearer to another marker's true position than to their own."""
    wrong, truth = find_wrong_markers(shot, markers)
    true_px: NDArray[np.float64] = truth.marker_xy_px
    distance_px = np.linalg.norm(markers.xy_px[wrong][:, None] - true_px, axis=2)
    return int((distance_px.argmin(axis=1) != np.flatnonzero(wrong)).sum()) if wrong.any() else 0


def _read_case(case: StressCase) -> DamageResult:
    result, shot, markers = read_case(case, 1, timing=False)
    return DamageResult(
        result, count_swapped_markers(shot, markers) if markers is not None and result.score.wrong else 0
    )


def read_cases(chosen: list[StressCase], processes: int) -> Iterator[DamageResult]:
    """Results in the order of completion."""
    if processes == 1:
        warm_up()
        yield from map(_read_case, chosen)
        return
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        yield from pool.imap_unordered(_read_case, chosen, chunksize=4)


def with_progress(chosen: list[StressCase], processes: int) -> list[DamageResult]:
    """All results in the order of seeds, with the progress on stderr."""
    results, started = [], time.perf_counter()
    for entry in read_cases(chosen, processes):
        results.append(entry)
        if sys.stderr.isatty() or len(results) % 200 == 0:
            text = f"{len(results)}/{len(chosen)} images, {time.perf_counter() - started:.0f} s"
            print(text, end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)
    return sorted(results, key=lambda entry: entry.result.case.seed)


def total_of_kind(kind: str, entries: Sequence[DamageResult]) -> DamageTotal:
    """The totals of the images of one kind."""
    results = [entry.result for entry in entries]
    read_in = [entry.score for entry in results if not entry.reason]
    scores = [entry.score for entry in results]
    return DamageTotal(
        kind=kind,
        images=len(results),
        unread=len(results) - len(read_in),
        raised=sum(entry.raised for entry in results),
        visible=sum(entry.visible for entry in scores),
        reported=sum(entry.reported for entry in scores),
        wrong=sum(entry.wrong for entry in scores),
        others=sum(entry.others for entry in entries),
        lost=sum(entry.lost for entry in scores),
        sure=sum(entry.sure for entry in read_in),
        kept=sum(entry.kept for entry in read_in),
        seeds=tuple((case_name(entry.case), entry.score.wrong) for entry in results if entry.score.wrong),
        calibrations=calibrations_by_position([entry.squares for entry in results]),
    )


def totals_by_kind(results: Sequence[DamageResult]) -> list[DamageTotal]:
    """One row per kind, and one of all images."""
    kinds = [kind.name for kind in RANDOM_KINDS]
    rows = [
        total_of_kind(kind, [entry for entry in results if entry.result.case.kind == kind]) for kind in kinds
    ]
    return [*(row for row in rows if row.images), total_of_kind("together", results)]


HEAD = (
    f"{'kind':<24}{'images':>8}{'unread':>8}{'visible':>10}{'reported':>10}{'wrong':>7}{'ids':>6}{'lost':>9}"
    f"{'sure':>10}{'kept %':>9}"
)


def totals_table(rows: Sequence[DamageTotal]) -> str:
    """The printed table; ``ids`` are the wrong markers at another marker's position."""
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


def calibration_table(rows: Sequence[DamageTotal]) -> str:
    """Errors over stated covariances, by kind and by how positions were found."""
    lines = [
        calibration_line(f"{row.kind}: {position}", calibration, NAME_WIDTH)
        for row in rows
        for position, calibration in row.calibrations.items()
    ]
    return "\n".join([calibration_head("errors over covariances", NAME_WIDTH), *lines])


def read_one_image(case: StressCase, save: Path | None) -> CaseResult:
    """Read one image in this process, print its wrong markers, and write the image with its overlay."""
    import cv2

    warm_up()
    result, shot, markers = read_case(case, 1, timing=False)
    print(result_line(result))
    for line in notable_lines(shot, markers):
        print(f"    {line}")
    if save is not None:
        save.mkdir(parents=True, exist_ok=True)
        stem = case_name(case).replace("/", "-").replace(" ", "_")
        cv2.imwrite(str(save / f"{stem}.png"), shot.image)
        if markers is not None:
            cv2.imwrite(str(save / f"{stem}.overlay.png"), draw_overlay(shot, case, markers))
    return result


def write_json(rows: Sequence[DamageTotal], path: Path) -> None:
    """Write every row as an object."""
    write_file(path, json.dumps([null_for_nan(asdict(row)) for row in rows], indent=1) + "\n")


def main(arguments: list[str] | None = None) -> int:
    """Print one row per kind and the images with wrong markers. Returns 1 if there is one, or an image raised."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.damage", description=__doc__.split("\n")[0])
    parser.add_argument("--images", type=int, default=IMAGES, metavar="N")
    parser.add_argument("--seed", type=int, default=SEED, metavar="S", help="of the first image")
    parser.add_argument("--only", metavar="NAME", help="one image: random blobs/round/5017")
    parser.add_argument("--save", type=Path, metavar="DIR", help="with --only: write image and overlay here")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    options = parser.parse_args(arguments)
    if options.only:
        try:
            result = read_one_image(parse_case(options.only), options.save)
        except ValueError as error:
            parser.error(str(error))
        return int(result.score.wrong > 0 or result.raised)
    started = time.perf_counter()
    rows = totals_by_kind(with_progress(sample_cases(options.images, options.seed), options.processes))
    print(totals_table(rows))
    print(calibration_table(rows))
    last = options.seed + options.images - 1
    print(f"{options.images} images, seeds {options.seed} to {last}; {time.perf_counter() - started:.0f} s")
    if options.json:
        write_json(rows, options.json)
    return int(any(row.wrong or row.raised for row in rows))


if __name__ == "__main__":
    sys.exit(main())
