"""Reading of the pictures of a suite by presets, and the rows of the report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice

from benchmarks.frame.pooled import grouped
from benchmarks.suites.calibration.suites import suites_by_name
from benchmarks.suites.scoring.calibration import Calibration
from benchmarks.suites.scoring.squares import (
    MEASURED,
    VIRTUAL_MEASURED,
    PictureSquares,
    calibrations_by_position,
    nearest_truth,
    picture_squares,
)
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from extractor import Extractor, parse_layout
from extractor.presets import Preset

TOGETHER = "together"


@dataclass(frozen=True)
class SuiteJob:
    """Every ``parts``-th picture of a suite from number ``part`` on, read by all ``presets``."""

    suite: str
    presets: tuple[Preset, ...]
    quick: bool = False
    seed: int = 0
    part: int = 0
    parts: int = 1


@dataclass(frozen=True, eq=False)
class PictureReading:
    """One picture, read by one preset. ``number`` is the picture's place in its suite."""

    suite: str
    kind: str
    number: int
    preset: Preset
    squares: PictureSquares


@lru_cache(maxsize=64)
def _cached_reader(layout: Layout, preset: Preset) -> Extractor:
    return Extractor(parse_layout(layout_to_json(layout)), preset)


def read_pictures(job: SuiteJob) -> list[PictureReading]:
    """The job's pictures in the order of the suite, each by all presets."""
    return list(_readings(job))


def _readings(job: SuiteJob) -> Iterator[PictureReading]:
    cases = enumerate(suites_by_name()[job.suite](job.quick, job.seed))
    for number, case in islice(cases, job.part, None, job.parts):
        shot = case.shoot()
        for preset in job.presets:
            markers = _cached_reader(case.layout, preset).extract(shot.image)
            squares = picture_squares(markers, nearest_truth(markers, shot.truths))
            yield PictureReading(job.suite, case.kind, number, preset, squares)


def in_order(readings_of_jobs: Iterable[Sequence[PictureReading]]) -> list[PictureReading]:
    """The readings of all jobs in the order of the suites, and of the pictures in each."""
    found = [reading for readings in readings_of_jobs for reading in readings]
    suites = list(dict.fromkeys(reading.suite for reading in found))
    return sorted(found, key=lambda reading: (suites.index(reading.suite), reading.number))


def calibrations_by_suite(readings: Sequence[PictureReading]) -> dict[str, dict[str, Calibration]]:
    """By preset and suite, then by kind and positions: of measured markers and virtual markers, of a suite together of
    all positions. The order of presets, suites and kinds is that of the readings' first entries.
    """
    found: dict[str, dict[str, Calibration]] = {}
    for preset, of_preset in grouped(readings, "preset").items():
        for suite, of_suite in grouped(of_preset, "suite").items():
            found[f"{preset}, {suite}"] = {
                f"{kind}: {positions}": one
                for kind, chosen in {**grouped(of_suite, "kind"), TOGETHER: of_suite}.items()
                for positions, one in calibrations_by_position([read.squares for read in chosen]).items()
                if kind == TOGETHER or positions in (MEASURED, VIRTUAL_MEASURED)
            }
    return found
