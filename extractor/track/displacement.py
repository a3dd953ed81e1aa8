"""Displacement against the rest frame, in pixels and in millimetres of the layout frame."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.layout.reference import Reference
from extractor.numeric.homographies import mapped

MIN_MARKERS = 4  # for a homography; derived: eight parameters
MAX_CONDITION = 1e6  # of the markers' scatter; collinear markers determine no homography. Chosen

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rest:
    """The pattern at rest, from which displacements are measured.

    Attributes:
        xy_px: (M, 2) float64, NaN where the rest frame has no marker.
        layout_from_image: (3, 3) float64, a homography from px to mm of the layout frame, fitted to all markers
            at rest; None when these are too few, or when ``mm_per_px`` is given.
        mm_per_px: a scale, with x right and y up along the image's axes; None without one.
        residual_mm: RMS distance per axis between the fitted and the layout's positions; NaN without a homography.
            It is microns for a flat sheet and an undistorted camera, and more for a dome or a lens.
    """

    xy_px: Points
    layout_from_image: NDArray[np.float64] | None
    mm_per_px: float | None
    residual_mm: float

    def displacement_px(self, xy_px: Points) -> Points:
        """(M, 2) px in the image frame (x right, y down), NaN where either frame lacks the marker."""
        return xy_px - self.xy_px

    def displacement_mm(self, xy_px: Points) -> Points:
        """(M, 2) mm, y up: in the layout frame, or along the image's axes with a scale; NaN where unknown."""
        if self.mm_per_px is not None:
            return (xy_px - self.xy_px) * (self.mm_per_px, -self.mm_per_px)
        if self.layout_from_image is None:
            return np.full_like(xy_px, np.nan)
        return mapped(self.layout_from_image, xy_px) - mapped(self.layout_from_image, self.xy_px)


NO_REST = Rest(np.full(2, np.nan), None, None, float("nan"))


def fit_rest(xy_px: Points, reference: Reference, mm_per_px: float | None = None) -> Rest:
    """The rest state with its markers at (M, 2) px, NaN where lost.

    Args:
        mm_per_px: a scale for millimetres; None: a homography to the layout.
    """
    xy_px = xy_px.copy()
    if mm_per_px is not None:
        return Rest(xy_px, None, mm_per_px, float("nan"))
    known = np.isfinite(xy_px[:, 0])
    mm, px = reference.xy_mm[known], xy_px[known]
    if known.sum() < MIN_MARKERS or np.linalg.cond(mm - mm.mean(axis=0)) > MAX_CONDITION:
        return Rest(xy_px, None, None, float("nan"))
    homography, _ = cv2.findHomography(px, mm)
    if homography is None:
        return Rest(xy_px, None, None, float("nan"))
    h = np.asarray(homography, dtype=np.float64)
    residual = float(np.sqrt(np.mean((mapped(h, px) - mm) ** 2)))
    return Rest(xy_px, h, None, residual)
