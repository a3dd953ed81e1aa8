"""All suites of calibration by name, with the camera suite where it offers pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module

from benchmarks.suites.calibration.cases import CalibrationCase
from benchmarks.suites.calibration.damaged import damage_cases, mild_dirt_cases, stress_cases
from benchmarks.suites.calibration.plain import plain_cases, scatter_cases

SuiteCases = Callable[[bool, int], Iterator[CalibrationCase]]  # quick, seed -> cases
CAMERA_PACKAGE = "benchmarks.suites.camera"
CAMERA_MODULE = f"{CAMERA_PACKAGE}.calibration"  # it offers ``camera_cases``, a ``SuiteCases``


def suites_by_name() -> dict[str, SuiteCases]:
    """Name -> the cases of a suite; camera is left out where ``CAMERA_MODULE`` is missing."""
    suites: dict[str, SuiteCases] = {
        "plain": plain_cases,
        "mild dirt": mild_dirt_cases,
        "damage": damage_cases,
        "stress": stress_cases,
        "scatter": scatter_cases,
    }
    try:
        suites["camera"] = import_module(CAMERA_MODULE).camera_cases
    except ModuleNotFoundError as error:
        if error.name not in (CAMERA_PACKAGE, CAMERA_MODULE):
            raise
    return suites
