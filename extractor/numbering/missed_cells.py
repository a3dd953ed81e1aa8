"""Whether recognition at a reduced scale has missed cells that the image shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import image_cell_of_layout_cell, linear_maps
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled

SMALL_AREA_PX = 30  # of a cell at the reduced scale; larger ones show all that they are
MIN_COSINE = 0.9  # between a color and the ink that should be there, grey taken off
MIN_STRENGTH_RATIO = 0.4  # of the ink's strength
SAMPLE_RADIUS = 0.12  # of the square root of a cell's area, over which colors are averaged
MAX_SAMPLED_CELLS = 60  # cells that say what the inks look like


def count_missed_cells(
    image: NDArray[np.uint8], cells: Cells, numbering: Numbering, lattice: Lattice, scale: int
) -> int:
    """How many cells are not numbered, but might be at a finer scale, because they are small at this one.

    These are the places beside numbered cells where the ink shows that must be there, and cells without a number
    for which the layout has places left, should most be small.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        scale: by which it was reduced.
    """
    small_px = float(SMALL_AREA_PX * scale * scale)
    return int(
        _count_missed(image, cells.center_px, cells.area_px, numbering.cell, lattice.layout_cells, small_px)
    )


@compiled
def _update_subtracting_gray(color):  # type: ignore[no-untyped-def]
    """Take the grey off a color, in place; its strength."""
    color -= color.min()
    return np.sqrt(color[0] ** 2 + color[1] ** 2 + color[2] ** 2)


@compiled
def _count_missed(image, center_px, area_px, cell, plan, small_px):  # type: ignore[no-untyped-def]
    """The small cells without a number that may have a place, and the places that show their ink."""
    numbered = np.flatnonzero(cell >= 0)
    free, loose = plan.ink.shape[0] - numbered.shape[0], cell.shape[0] - numbered.shape[0]
    if free == 0:
        return 0
    if loose > 0 and np.median(area_px[numbered]) > small_px:
        loose = 0
    return min(loose, free) + _count_visible_places(image, center_px, area_px, cell, numbered, plan, small_px)


@compiled
def _mean_ink_colors(image, center_px, area_px, cell, numbered, ink):  # type: ignore[no-untyped-def]
    """(4, 3) the mean colors of the inks by some cells, grey taken off, 0 where there is none, and their strength."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    usual, strength, color, own = np.zeros((4, 3)), np.zeros(4), np.zeros(3), np.zeros(4)
    every = max(1, numbered.shape[0] // MAX_SAMPLED_CELLS)
    every += every % 3 == 0  # along a row every third cell has the same ink
    for i in numbered[::every]:
        radius = SAMPLE_RADIUS * np.sqrt(area_px[i])
        if fill_patch_mean(flat, height, width, center_px[i, 0], center_px[i, 1], radius, color):
            for channel in range(3):
                usual[ink[cell[i]], channel] += color[channel]
            own[ink[cell[i]]] += 1.0
    for k in range(1, 4):
        usual[k] /= max(own[k], 1.0)
        strength[k] = _update_subtracting_gray(usual[k])
    return usual, strength


@compiled
def _places_beside_free(seen, cell, beside):  # type: ignore[no-untyped-def]
    """(N,) int32, the numbers of the cells beside places of the layout where none is ``seen`` (U,), else -1."""
    out = np.full(cell.shape[0], -1, np.int32)
    for v in range(seen.shape[0]):
        for k in range(6):
            if seen[v] < 0 and beside[v, k] >= 0 and seen[beside[v, k]] >= 0:
                out[seen[beside[v, k]]] = beside[v, k]
    return out


@compiled
def _count_visible_places(image, center_px, area_px, cell, numbered, plan, small_px):  # type: ignore[no-untyped-def]
    """How many places beside numbered cells, where cells are small, show the ink that must be there."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    seen = image_cell_of_layout_cell(cell, plan.ink.shape[0])
    slope = linear_maps(
        center_px,
        _places_beside_free(seen, cell, plan.cell_neighbours),
        seen,
        plan.center_mm,
        plan.cell_neighbours,
    )
    usual, strength = np.empty((0, 3)), np.empty(0)
    count, color = 0, np.zeros(3)
    for v in range(seen.shape[0]):
        if seen[v] >= 0:
            continue
        x, y, size, witnesses = 0.0, 0.0, 0.0, 0
        for k in range(6):
            u = plan.cell_neighbours[v, k]
            if u < 0 or seen[u] < 0 or np.isnan(slope[seen[u], 0, 0]):
                continue
            i = seen[u]
            dx, dy = plan.center_mm[v, 0] - plan.center_mm[u, 0], plan.center_mm[v, 1] - plan.center_mm[u, 1]
            x += center_px[i, 0] + slope[i, 0, 0] * dx + slope[i, 0, 1] * dy
            y += center_px[i, 1] + slope[i, 1, 0] * dx + slope[i, 1, 1] * dy
            size += area_px[i]
            witnesses += 1
        if witnesses == 0 or size > small_px * witnesses:
            continue
        if strength.shape[0] == 0:  # in most images no place comes so far
            usual, strength = _mean_ink_colors(image, center_px, area_px, cell, numbered, plan.ink)
        if strength[plan.ink[v]] == 0.0:
            continue
        radius = SAMPLE_RADIUS * np.sqrt(size / witnesses)
        if not fill_patch_mean(flat, height, width, x / witnesses, y / witnesses, radius, color):
            continue
        shown, wanted = _update_subtracting_gray(color), usual[plan.ink[v]]
        likeness = color[0] * wanted[0] + color[1] * wanted[1] + color[2] * wanted[2]
        if (
            shown > MIN_STRENGTH_RATIO * strength[plan.ink[v]]
            and likeness > MIN_COSINE * shown * strength[plan.ink[v]]
        ):
            count += 1
    return count
