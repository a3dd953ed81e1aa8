"""Between numbering and refinement: every marker's place, agreed upon by the corners that carry its id."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .numbering import Numbering
from .triangles import Triangles

MAX_SPREAD = 0.3  # how far a corner may lie from the mean of its marker's, in units of the edges there


@dataclass(frozen=True, eq=False)
class Places:
    """Numbered markers before refinement.

    Attributes:
        xy_px: (M, 2) float64, the mean of the corners, NaN where there is none or they disagree.
        edge_px: (M,) float64, the mean length of the edges at each marker, NaN where there is none.
        cells: (C, 3) int32, marker ids of the numbered cells' corners, clockwise in the image.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    cells: NDArray[np.int32]


def place(triangles: Triangles, numbering: Numbering, count: int) -> Places:
    """Merge the corners of each id; a marker whose corners lie apart has a wrong one among them and is lost."""
    cells = numbering.marker_of_corner[numbering.cell_of_triangle >= 0]
    corners = triangles.corner_px[numbering.cell_of_triangle >= 0]
    ids, flat = cells.reshape(-1), corners.reshape(-1, 2)
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    around = (0.5 * (sides + np.roll(sides, 1, axis=1))).reshape(-1)
    members = np.bincount(ids, minlength=count)
    with np.errstate(invalid="ignore"):
        xy = np.stack(
            [np.bincount(ids, weights=flat[:, a], minlength=count) / members for a in (0, 1)], axis=1
        )
        edge = np.bincount(ids, weights=around, minlength=count) / members
    apart = np.linalg.norm(flat - xy[ids], axis=1) > MAX_SPREAD * edge[ids]
    xy[ids[apart]] = np.nan
    whole = np.isfinite(xy[cells, 0]).all(axis=1)
    return Places(xy_px=xy, edge_px=edge, cells=cells[whole])
