"""All suites of calibration by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from benchmarks.frame.conditions import commit_seed
from benchmarks.suites.calibration.camera import camera_cases
from benchmarks.suites.calibration.cases import CalibrationCase
from benchmarks.suites.calibration.damaged import damage_cases, mild_dirt_cases, stress_cases
from benchmarks.suites.calibration.plain import plain_cases, scatter_cases

SuiteCases = Callable[[bool, int], Iterator[CalibrationCase]]  # quick, seed -> cases
CAMERA = "camera"


def suites_by_name() -> dict[str, SuiteCases]:
    """Name -> the cases of a suite."""
    return {
        "plain": plain_cases,
        "mild dirt": mild_dirt_cases,
        "damage": damage_cases,
        "stress": stress_cases,
        "scatter": scatter_cases,
        CAMERA: camera_cases,
    }


def usual_seed(suite: str) -> int:
    """The seed of a run without ``--seed``: the commit's for the camera suite, 0 for all others.

    Raises:
        ValueError: the camera suite outside a repository.
    """
    return commit_seed() if suite == CAMERA else 0
