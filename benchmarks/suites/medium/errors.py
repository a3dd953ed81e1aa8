"""Depth errors of readings under assumptions of the medium, and their pools."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.medium.rigs import PressedFrame, RandomRig, read_rig
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Medium
from extractor import Reconstructor, parse_layout

Array = NDArray[np.float64]

LIMIT_UM, LIMIT_SHARE = 2.0, 0.003
TRUE, TILT, AIR = "true constants", "window tilted by 1 degree", "no medium"
CHANGES: dict[str, dict[str, float]] = {
    "gel's index off by 0.01": {"gel_index": 0.01},
    "window's index off by 0.01": {"window_index": 0.01},
    "gel's thickness off by 0.5 mm": {"gel_mm": 0.5},
    "window's thickness off by 0.5 mm": {"window_mm": 0.5},
}
ROWS = (TRUE, *CHANGES, TILT, AIR)


@dataclass(frozen=True)
class DepthErrors:
    """The errors of one frame under one assumption.

    Attributes:
        row: the assumption.
        press_mm: the press.
        depth_um: (N,) errors of the displacement along z of pressed markers.
        short: share by which their measured displacement is too small.
        position: (M,) squared errors of positions over their covariances, per axis.
        displacement: (M,) the same of displacements.
        misfit: of the rest frame.
        warned: the rest frame is warned about.
    """

    row: str
    press_mm: float
    depth_um: Array
    short: float
    position: Array
    displacement: Array
    misfit: float
    warned: bool

    @property
    def mean_um(self) -> float:
        """The mean absolute depth error."""
        return float(np.abs(self.depth_um).mean())

    @property
    def bias_um(self) -> float:
        """The absolute mean depth error."""
        return abs(float(self.depth_um.mean()))

    @property
    def limit_um(self) -> float:
        """Limit of the mean depth error with true constants."""
        return LIMIT_UM + 1e3 * LIMIT_SHARE * self.press_mm

    @property
    def short_percent(self) -> float:
        return 100 * self.short

    @property
    def warned_percent(self) -> float:
        return 100.0 * self.warned


def measure_rig(found: RandomRig, rng: np.random.Generator) -> Iterator[DepthErrors]:
    """The errors of every press under every assumption."""
    for straight, tilted in read_rig(found, rng):
        yield depth_errors(TRUE, found, straight, found.medium)
        for row, steps in CHANGES.items():
            for sign in (1, -1):
                changed = {field: getattr(found.medium, field) + sign * step for field, step in steps.items()}
                yield depth_errors(row, found, straight, replace(found.medium, **changed))  # type: ignore[arg-type]
        yield depth_errors(TILT, found, tilted, found.medium)
        yield depth_errors(AIR, found, straight, None)


def depth_errors(row: str, found: RandomRig, reading: PressedFrame, medium: Medium | None) -> DepthErrors:
    """The errors of a reading if this were the medium."""
    layout = parse_layout(layout_to_json(found.layout))
    reconstructor = Reconstructor(layout, found.rig(medium), reading.rest)
    shape = reconstructor.reconstruct(reading.markers)
    true = reading.truth.marker_xyz_mm
    moved = true - np.column_stack([layout.xy_mm, np.zeros(len(true))])
    known = np.isfinite(shape.displacement_mm[:, 2])
    pressed = known & (-moved[:, 2] > 0.5 * reading.press_mm)
    read_mm, true_mm = shape.displacement_mm[pressed, 2], moved[pressed, 2]
    return DepthErrors(
        row,
        reading.press_mm,
        1e3 * (read_mm - true_mm),
        1 - float(read_mm @ true_mm / (true_mm @ true_mm)),
        squares((shape.xyz_mm - true)[known], shape.cov_mm2[known]),
        squares((shape.displacement_mm - moved)[known], shape.displacement_cov_mm2[known]),
        reconstructor.poses.misfit,
        bool(reconstructor.warnings),
    )


def squares(error: Array, cov: Array) -> Array:
    """(N,) squared errors over their covariances, per axis."""
    return np.asarray(np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error) / error.shape[1])
