"""Stage 6: the cell mesh links the cells that share a corner, by the cells' triangles alone (eqs. 4 and 5).

A link is mutual: each of two cells has a corner that is the nearest to a corner of the other. Their shapes may
differ; the directions to each other need only agree roughly with their own triangles. No color decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.cells import Cells


class CellLinks(NamedTuple):
    """The links of N cells as native loops take them.

    Attributes:
        neighbours: (N, 6) int32, the linked cells, or -1.
        back: (N, 6) int8, the step by which each of them leads back, or -1.
        misfit: (N, 6) float64, in edges, between the corners.
    """

    neighbours: NDArray[np.int32]
    back: NDArray[np.int8]
    misfit: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CellMesh:
    """Stage 6.

    Attributes:
        links: the links of the cells.
        swelling: sides of the cells' triangles over those at which neighbours just meet. Ink that bled and
            overexposure make cells larger.
        corner_px: (N, 3, 2) float64, the corners of the cells whose sides are divided by the swelling.
    """

    links: CellLinks
    swelling: float
    corner_px: NDArray[np.float64]

    @property
    def is_linked(self) -> NDArray[np.bool_]:
        """(N,) bool, the cells with a link."""
        return np.asarray((self.links.neighbours >= 0).any(axis=1))


def build_cell_mesh(cells: Cells) -> CellMesh:
    """Stage 6: the links of the cells."""
    links, swelling = native.link_cells(cells.centre_px, cells.corner_px)
    centre = cells.centre_px[:, None]
    return CellMesh(links, swelling, centre + (cells.corner_px - centre) / swelling)
