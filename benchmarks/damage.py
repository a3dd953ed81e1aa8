"""Random damage: the number of wrong markers and their images, over any number of seeds.

Scratches, drops, reflections and missing cells of any color, size and number, on surfaces pressed, twisted, sheared and
tilted, under light of any color. Fresh seeds are images that no rule of the extractor has been tuned on. "ids" are the
wrong markers at another marker's position; "kept" is the share of the sure markers, those off the image's rim with a
visible cell, that is measured or repaired.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.frame.experiment import Experiment, Found, OptionError, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.pooled import Columns, grouped, pooled_table, share, total
from benchmarks.frame.table import Table
from benchmarks.suites.scoring.calibration import Calibration, calibration_table
from benchmarks.suites.scoring.reading import (
    CaseReading,
    CaseResult,
    draw_overlay,
    notable_lines,
    read_case,
)
from benchmarks.suites.scoring.report import result_line
from benchmarks.suites.scoring.squares import calibrations_by_position
from benchmarks.suites.stress.frames import PATTERNS
from benchmarks.suites.stress.kinds import StressCase
from benchmarks.suites.stress.random_damage import RANDOM_KINDS

SEED = 5000
COLUMNS: Columns = {
    "images": ("d", len),
    "unread": ("d", lambda results: sum(bool(one.reason) for one in results)),
    "visible": ("d", total("score.visible")),
    "reported": ("d", total("score.reported")),
    "wrong": ("d", total("score.wrong")),
    "ids": ("d", total("score.others")),
    "lost": ("d", total("score.lost")),
    "sure": ("d", lambda results: total("score.sure")(read_in(results))),
    "kept": (".2%", lambda results: share("score.kept", "score.sure")(read_in(results))),
}


def read_in(results: Sequence[CaseResult]) -> list[CaseResult]:
    """Those with markers."""
    return [one for one in results if not one.reason]


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


def read_damaged(case: StressCase) -> CaseResult:
    return read_case(case, 1, timing=False).result


def by_kind(results: Sequence[CaseResult]) -> dict[str, list[CaseResult]]:
    """The images of each kind, and all of them."""
    return {**grouped(results, "case.kind"), "together": list(results)}


def totals_table(results: Sequence[CaseResult]) -> Table:
    """One row per kind, and one of all images."""
    return pooled_table("random damage", "kind", COLUMNS, by_kind(results))


def wrong_lines(results: Sequence[CaseResult]) -> list[str]:
    """The images with wrong markers, and the number of those that raised."""
    lines = [f"WRONG {one.score.wrong:>4}  {case_name(one.case)}" for one in results if one.score.wrong]
    raised = sum(one.raised for one in results)
    return [*lines, *[f"RAISED {raised} images"] * bool(raised)]


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
    results = results_of(read_damaged, sample_cases(images, seed), processes)
    yield totals_table(results)
    yield from wrong_lines(results)
    found: dict[str, Calibration] = {
        f"{kind}: {position}": stated
        for kind, of_kind in by_kind(results).items()
        for position, stated in calibrations_by_position([one.squares for one in of_kind]).items()
    }
    yield calibration_table("errors over covariances", found)
    yield f"{images} images, seeds {seed} to {seed + images - 1}"
    return Found(failed=any(one.score.wrong or one.raised for one in results))


main = Experiment("damage", measure)
main.run_as(__name__)
