"""Between recognition and numbering: the colored cells, with their triangles and centers. Blur moves no center."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import cells as native
from extractor.cells.seeds import Seeds
from extractor.cells.triangle_fit import Triangles


class CellLimits(NamedTuple):
    """Limits of the cells' areas.

    Attributes:
        nearest_cells: cells with which an area is compared. Chosen.
        min_area_share: of the neighbours' median area; smaller domains are dirt. Measured: rule "larger neighbours".
        max_larger_than_cell: number of nearest cells that make a domain dirt if so much larger: half of
            ``nearest_cells``, for the median. Derived.
        min_intact_share: of the neighbours' upper quartile; smaller cells are cut, their centers shifted. Measured:
            rule "intact cells".
        max_larger_than_intact: number of nearest cells that make a cell a cut one if so much larger: a quarter of
            ``nearest_cells`` and one more, for the upper quartile. Derived.
        min_triangle_share: share of triangles among the cells from which on every other cell is a fragment. Chosen.
        count_radii: within which cells are counted, in sides of a bucket; they save time and decide nothing. The five
            by five buckets around a point hold all cells within 2; a disc of 1.1 holds about ``nearest_cells``. Chosen.
    """

    nearest_cells: int = 8
    min_area_share: float = 0.2
    max_larger_than_cell: int = 4
    min_intact_share: float = 0.7
    max_larger_than_intact: int = 3
    min_triangle_share: float = 0.6
    count_radii: tuple[float, ...] = (1.99, 1.5, 1.25, 1.05, 0.9, 0.75)


LIMITS = CellLimits()


class CellArrays(NamedTuple):
    """The image's colored cells for native loops.

    Attributes:
        center_px, ink, area_px, corner_px: as in ``Cells``.
        is_intact: (N,) bool, as ``Cells.is_intact``.
    """

    center_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    area_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]
    is_intact: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Cells:
    """The image's colored cells.

    Attributes:
        center_px: (N, 2) float64 in the image frame.
        ink: (N,) uint8, 1 red, 2 green, 3 blue.
        area_px: (N,) float64, px^2.
        corner_px: (N, 3, 2) float64, the corners clockwise in the image; NaN where the region is no triangle.
    """

    center_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    area_px: NDArray[np.float64]
    corner_px: NDArray[np.float64]

    @property
    def edge_px(self) -> float:
        """The edge of an equilateral triangle of the median area; 0 without cells."""
        return float(native.equilateral_edge(self.area_px))

    @cached_property
    def is_intact(self) -> NDArray[np.bool_]:
        """(N,) bool, cells with a reliable center: about as large as the neighbours and, if most are, triangles."""
        return np.asarray(native.is_intact(self.center_px, self.area_px, self.corner_px, LIMITS))

    @cached_property
    def arrays(self) -> CellArrays:
        """The cells as native loops take them."""
        return CellArrays(self.center_px, self.ink, self.area_px, self.corner_px, self.is_intact)


def find_cells(seeds: Seeds, triangles: Triangles, scale: int) -> Cells:
    """The domains that are large enough for cells, at full scale; in a cluttered image triangles only.

    Args:
        seeds: the domains, at 1/``scale`` of the image's scale.
        triangles: at full scale.
        scale: full-scale pixels per pixel of the seeds.
    """
    found = triangles.region, triangles.corner_px
    domains = seeds.center, seeds.ink, seeds.area_px
    return Cells(*native.cell_arrays(*domains, *found, scale, seeds.cluttered, LIMITS))


def cells_with_triangles(cells: Cells, triangles: Triangles) -> Cells:
    """A copy of the cells with other triangles; ``triangles.region`` is the index of the cell."""
    center, corners = cells.center_px.copy(), cells.corner_px.copy()
    corners[triangles.region] = triangles.corner_px
    center[triangles.region] = triangles.corner_px.mean(axis=1)
    return Cells(center, cells.ink, cells.area_px, corners)
