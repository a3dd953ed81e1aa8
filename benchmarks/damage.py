"""Random damage: the number of wrong markers and their images, over any number of seeds.

Scratches, drops, reflections and missing cells of any color, size and number, on surfaces pressed, twisted, sheared and
tilted, under light of any color. Fresh seeds are images that no rule of the extractor has been tuned on. "ids" are the
wrong markers at another marker's position; "kept" is the share of the sure markers, those off the image's rim with a
visible cell, that is measured or repaired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Found, OptionError, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scoring.calibration import Calibration, calibration_table
from benchmarks.suites.scoring.reading import (
    CaseReading,
    CaseResult,
    draw_overlay,
    find_wrong_markers,
    notable_lines,
    read_case,
)
from benchmarks.suites.scoring.report import result_line
from benchmarks.suites.scoring.squares import calibrations_by_position
from benchmarks.suites.stress.frames import PATTERNS, CaseImage
from benchmarks.suites.stress.kinds import StressCase
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from extractor import Markers

SEED = 5000
COLUMNS = {
    "kind": TEXT, "images": "d", "unread": "d", "visible": "d", "reported": "d", "wrong": "d", "ids": "d", "lost": "d",
    "sure": "d", "kept": ".2%",
}  # fmt: skip


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


def read_damaged(case: StressCase) -> DamageResult:
    result, shot, markers = read_case(case, 1, timing=False)
    return DamageResult(
        result, count_swapped_markers(shot, markers) if markers is not None and result.score.wrong else 0
    )


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


def totals_table(rows: Sequence[DamageTotal]) -> Table:
    """One row per kind, and one of all images."""
    return Table(
        "random damage",
        COLUMNS,
        [
            (r.kind, r.images, r.unread, r.visible, r.reported, r.wrong, r.others, r.lost, r.sure,
             r.kept / r.sure if r.sure else None)
            for r in rows
        ],
    )  # fmt: skip


def wrong_lines(together: DamageTotal) -> list[str]:
    """The images with wrong markers."""
    lines = [f"WRONG {count:>4}  {name}" for name, count in together.seeds]
    return [*lines, *[f"RAISED {together.raised} images"] * bool(together.raised)]


def save_image(read: CaseReading, folder: Path) -> None:
    """Write an image and its overlay."""
    import cv2

    folder.mkdir(parents=True, exist_ok=True)
    stem = case_name(read.result.case).replace("/", "-").replace(" ", "_")
    cv2.imwrite(str(folder / f"{stem}.png"), read.shot.image)
    if read.markers is not None:
        overlay = draw_overlay(read.shot, read.result.case, read.markers)
        cv2.imwrite(str(folder / f"{stem}.overlay.png"), overlay)


def measure(
    images: int = 2100,
    seed: int = SEED,
    only: str = "",
    save: Path | None = None,
    processes: int = PROCESSES,
) -> Shown:
    """One row per kind and the images with wrong markers; fails if there is one, or an image raised.

    Args:
        seed: of the first image.
        only: one image, as "random blobs/round/5017"; it is read alone.
        save: with --only: a folder for the image and its overlay.
    """
    if only:
        try:
            read = read_case(parse_case(only), 1, timing=False)
        except ValueError as error:
            raise OptionError(error) from None
        yield "\n    ".join([result_line(read.result), *notable_lines(read.shot, read.markers)])
        if save:
            save_image(read, save)
        return Found(failed=read.result.score.wrong > 0 or read.result.raised)
    rows = totals_by_kind(results_of(read_damaged, sample_cases(images, seed), processes))
    yield totals_table(rows)
    yield from wrong_lines(rows[-1])
    found: dict[str, Calibration] = {
        f"{row.kind}: {position}": stated for row in rows for position, stated in row.calibrations.items()
    }
    yield calibration_table("errors over covariances", found)
    yield f"{images} images, seeds {seed} to {seed + images - 1}"
    return Found(failed=any(row.wrong or row.raised for row in rows))


main = Experiment("damage", measure)

if __name__ == "__main__":
    raise SystemExit(main())
