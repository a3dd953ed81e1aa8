"""Errors of the reconstructed surface under pressed objects, against the true surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluation.simulated.conditions import ImagingConditions
from cmpdesign.evaluation.simulated.contacts import PlacedSurface
from cmpdesign.evaluation.simulated.instrument import Instrument
from extractor.errors import PoseError

Points = NDArray[np.float64]
ERROR_NAMES = (
    "surface_rms_mm", "depth_rms_mm", "marker_rms_mm", "marker_median_mm", "over_sigma", "over_sigma_median",
)  # fmt: skip
GRID_SPACING_MM = 0.25  # of the grid on which surfaces are compared
CHI_SQUARE_MEDIAN_3 = 2.365973884375338  # of three degrees of freedom
# Surfaces are compared where the displacement is at least this share of the largest displacement.
CONTACT_DISPLACEMENT_SHARE = 0.1


def measure_reconstruction(
    instrument: Instrument, surface: PlacedSurface, conditions: ImagingConditions, seed: int
) -> dict[str, Any]:
    """Errors of one picture's reconstruction.

    Args:
        instrument: the pattern on its sensor.
        surface: the true surface.
        conditions: light, blur, noise and dirt.
        seed: the picture's seed.

    Returns:
        ``surface_rms_mm`` of the displacement vector and ``depth_rms_mm`` of its z, on a grid over the contact's
        area; ``covered``, the share of that grid where the pattern gives a surface; ``marker_rms_mm`` and
        ``marker_median_mm`` of the markers' positions; ``measured``, the share of the visible markers with a position;
        ``over_sigma``, the RMS of the positions' errors in units of their stated covariance, and
        ``over_sigma_median``, the normalised median (both 1 for a true covariance). Values are None where no marker
        was read, or the pattern cannot be read even at rest.
    """
    try:
        reconstructor = instrument.reconstructor
    except PoseError:
        return {**dict.fromkeys(ERROR_NAMES), "covered": 0.0, "measured": 0.0}
    picture = instrument.picture(conditions, seed, surface)
    shape = reconstructor.reconstruct(instrument.read(picture.image))
    truth = picture.truth
    grid = comparison_grid_mm(instrument)
    displacement_mm = surface.displacement_mm(grid)
    length = np.linalg.norm(displacement_mm, axis=1)
    area = length >= CONTACT_DISPLACEMENT_SHARE * length.max()
    dense = reconstructor.field.at(shape.displacement_mm, grid[area])
    error = dense - displacement_mm[area]
    known = np.isfinite(error[:, 0])
    distance_mm = np.linalg.norm(shape.xyz_mm - truth.marker_xyz_mm, axis=1)
    visible = np.asarray(truth.visible).all(axis=0)
    return {
        "surface_rms_mm": _rms(np.linalg.norm(error[known], axis=1)),
        "depth_rms_mm": _rms(error[known, 2]),
        "covered": float(known.mean()) if len(known) else 0.0,
        "marker_rms_mm": _rms(distance_mm[np.isfinite(distance_mm)]),
        "marker_median_mm": float(np.nanmedian(distance_mm)) if np.isfinite(distance_mm).any() else None,
        **_normalised_errors(shape.xyz_mm - truth.marker_xyz_mm, shape.cov_mm2),
        "measured": float((visible & np.isfinite(distance_mm)).sum() / max(int(visible.sum()), 1)),
    }


def comparison_grid_mm(instrument: Instrument) -> Points:
    """(N, 2) mm: a square grid over the pattern's cells, one edge inside the rim, so that every pattern covers it."""
    corners = instrument.layout.marker_xy_mm[instrument.layout.present]
    low, high = corners.min(axis=0) + instrument.pitch_mm, corners.max(axis=0) - instrument.pitch_mm
    x, y = (np.arange(low[k], high[k], GRID_SPACING_MM) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    triangle, _ = instrument.reconstructor.field.find(grid)
    return np.asarray(grid[triangle >= 0])


def _normalised_errors(error_mm: Points, cov_mm2: Points) -> dict[str, float | None]:
    """Errors (M, 3) in units of covariances (M, 3, 3): RMS, and the median over the normal distribution's median."""
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
