"""What a coverage engine is asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.parts.optics import PointSpread


@dataclass(frozen=True, eq=False)
class CoverageTask:
    """What an engine needs.

    Attributes:
        segments: (N, 4) float64 u0, v0, u1, v1 in samples; sample (0, 0) is the first that any pixel uses,
            and the splines' knots are the integers.
        owner: (N,) int64.
        values: (polygons, planes) float64, what a fully covered sample shows, signed by orientation.
        columns, rows: samples that the image uses.
        spread: the point spread.
        width: pixels in a row.
        quadrature: Gauss-Legendre nodes and weights (2, degree + 1) on [0, 1].
    """

    segments: NDArray[np.float64]
    owner: NDArray[np.int64]
    values: NDArray[np.float64]
    columns: int
    rows: int
    spread: PointSpread
    width: int
    quadrature: NDArray[np.float64]
