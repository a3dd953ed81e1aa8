"""How the layout lies in the image around every numbered cell: a local linear map, pixels per millimetre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .lattice import SIX, layer_of, marker_id
from .tables import Lattice

MIN_SPREAD = 0.2  # of the neighbours across against along, below which they are one line and tell nothing


@compiled
def _gradients(center_px, cell, center_mm, axial, cell_of, layers, seen_as):  # type: ignore[no-untyped-def]
    """(N, 2, 2) least squares over the six neighbours of each cell, NaN where they lie on one line."""
    out = np.full((cell.shape[0], 2, 2), np.nan)
    for i in range(cell.shape[0]):
        u = cell[i]
        if u < 0:
            continue
        xx, xy, yy = 0.0, 0.0, 0.0
        ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
        for k in range(6):
            q, r = axial[u, 0] + SIX[k, 0], axial[u, 1] + SIX[k, 1]
            if layer_of(q, r) > layers:
                continue
            v = cell_of[marker_id(q, r)]
            if v < 0 or seen_as[v] < 0:
                continue
            j = seen_as[v]
            x, y = center_mm[v, 0] - center_mm[u, 0], center_mm[v, 1] - center_mm[u, 1]
            px, py = center_px[j, 0] - center_px[i, 0], center_px[j, 1] - center_px[i, 1]
            xx += x * x
            xy += x * y
            yy += y * y
            ax += px * x
            ay += px * y
            bx += py * x
            by += py * y
        determinant = xx * yy - xy * xy
        if determinant > MIN_SPREAD * MIN_SPREAD * 0.25 * (xx + yy) ** 2:
            out[i, 0, 0] = (ax * yy - ay * xy) / determinant
            out[i, 0, 1] = (ay * xx - ax * xy) / determinant
            out[i, 1, 0] = (bx * yy - by * xy) / determinant
            out[i, 1, 1] = (by * xx - bx * xy) / determinant
    return out


def gradients(
    center_px: NDArray[np.float64], cell: NDArray[np.int32], lattice: Lattice
) -> NDArray[np.float64]:
    """(N, 2, 2) float64, image step (px) per layout step (mm) around each numbered cell; NaN where unknown.

    The layout's own shape is in its millimetres, so a round pattern is no more curved than a honeycomb.
    """
    seen_as = np.full(len(lattice.ink), -1, np.int32)
    numbered = np.flatnonzero(cell >= 0)
    seen_as[cell[numbered]] = numbered
    tables = lattice.center_mm, lattice.axial, lattice.cell_of, lattice.layers
    return np.asarray(_gradients(center_px, cell, *tables, seen_as))
