"""Objects pressed into the sensor: the surface that a pattern reconstructs, against the true one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate.simulated.conditions import ImagingConditions
from cmpdesign.evaluate.simulated.contacts import PlacedSurface
from cmpdesign.evaluate.simulated.instrument import Instrument
from extractor.errors import PoseError

Points = NDArray[np.float64]
ERROR_NAMES = (
    "surface_rms_mm", "depth_rms_mm", "marker_rms_mm", "marker_median_mm", "over_sigma", "over_sigma_median",
)  # fmt: skip
GRID_SPACING_MM = 0.25  # of the grid on which surfaces are compared
CHI_SQUARE_MEDIAN_3 = 2.365973884375338  # of three degrees of freedom
CONTACT_DISPLACEMENT_SHARE = (
    0.1  # the area compared: where the surface has moved by at least this share of the largest movement
)


def measure_reconstruction(
    one: Instrument, pressed: PlacedSurface, drawn: ImagingConditions, seed: int
) -> dict[str, Any]:
    """Errors of one picture's reconstruction.

    Returns:
        ``surface_rms_mm`` of the displacement's length and ``depth_rms_mm`` of its z, on a grid over the contact's
        area; ``covered``, the share of that grid where the pattern gives a surface; ``marker_rms_mm`` and
        ``marker_median_mm`` of the markers' places; ``measured``, the share of the visible markers that have one;
        ``over_sigma``, the RMS of the places' errors in units of their own stated covariance, and
        ``over_sigma_median``, its typical value (both 1 where the covariance is true). None where nothing
        was read, or the pattern cannot be read even at rest.
    """
    try:
        reconstructor = one.reconstructor
    except PoseError:
        return {**dict.fromkeys(ERROR_NAMES), "covered": 0.0, "measured": 0.0}
    picture = one.picture(drawn, seed, pressed)
    shape = reconstructor.reconstruct(one.read(picture.image))
    truth = picture.truth
    grid = comparison_grid_mm(one)
    moved = pressed.displacement_mm(grid)
    length = np.linalg.norm(moved, axis=1)
    area = length >= CONTACT_DISPLACEMENT_SHARE * length.max()
    found = reconstructor.field.at(shape.displacement_mm, grid[area])
    error = found - moved[area]
    known = np.isfinite(error[:, 0])
    away = np.linalg.norm(shape.xyz_mm - truth.marker_xyz_mm, axis=1)
    visible = np.asarray(truth.visible).all(axis=0)
    return {
        "surface_rms_mm": _rms(np.linalg.norm(error[known], axis=1)),
        "depth_rms_mm": _rms(error[known, 2]),
        "covered": float(known.mean()) if len(known) else 0.0,
        "marker_rms_mm": _rms(away[np.isfinite(away)]),
        "marker_median_mm": float(np.nanmedian(away)) if np.isfinite(away).any() else None,
        **_normalised_errors(shape.xyz_mm - truth.marker_xyz_mm, shape.cov_mm2),
        "measured": float((visible & np.isfinite(away)).sum() / max(int(visible.sum()), 1)),
    }


def comparison_grid_mm(one: Instrument) -> Points:
    """(N, 2) a square grid over the pattern's cells, away from the rim by one edge, so that every pattern covers it."""
    corners = one.layout.marker_xy_mm[one.layout.present]
    low, high = corners.min(axis=0) + one.pitch_mm, corners.max(axis=0) - one.pitch_mm
    x, y = (np.arange(low[k], high[k], GRID_SPACING_MM) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    triangle, _ = one.reconstructor.field.find(grid)
    return np.asarray(grid[triangle >= 0])


def _normalised_errors(error_mm: Points, cov_mm2: Points) -> dict[str, float | None]:
    """Errors (M, 3) in units of covariances (M, 3, 3): RMS, and the median over a true normal's median."""
    known = np.isfinite(error_mm[:, 0])
    if not known.any():
        return {"over_sigma": None, "over_sigma_median": None}
    inverse = np.linalg.inv(cov_mm2[known])
    square = np.einsum("ni,nij,nj->n", error_mm[known], inverse, error_mm[known])
    return {
        "over_sigma": float(np.sqrt(square.mean() / 3)),
        "over_sigma_median": float(np.sqrt(np.median(square) / CHI_SQUARE_MEDIAN_3)),
    }


def _rms(values: Points) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
