"""The input of a coverage engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.parts.optics import PointSpread


@dataclass(frozen=True, eq=False)
class CoverageTask:
    """The input of a coverage engine.

    Attributes:
        segments: (N, 4) float64 u0, v0, u1, v1 in samples; sample (0, 0) is the first sample of any pixel,
            and the splines' knots are the integers.
        owner: (N,) int64, the polygon of each segment.
        values: (polygons, planes) float64, the value of a fully covered sample, signed by orientation.
        columns, rows: samples of the image.
        spread: the point spread.
        width: pixels in a row.
        quadrature: (2, degree + 1) Gauss-Legendre nodes and weights on [0, 1].
    """

    segments: NDArray[np.float64]
    owner: NDArray[np.int64]
    values: NDArray[np.float64]
    columns: int
    rows: int
    spread: PointSpread
    width: int
    quadrature: NDArray[np.float64]
