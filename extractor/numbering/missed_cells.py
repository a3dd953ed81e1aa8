"""Counts cells that the image shows and that recognition at a reduced scale may have missed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.localmap.affine_maps import image_cell_of_layout_cell, linear_maps
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled

SMALL_AREA_PX = 30  # px^2, of a cell at the reduced scale; a finer scale adds nothing to larger cells
MIN_COSINE = 0.9  # between a color and the expected ink, both without their gray part
MIN_STRENGTH_RATIO = 0.4  # of a color's strength to the ink's
SAMPLE_RADIUS = 0.12  # of the square root of a cell's area, over which colors are averaged
MAX_SAMPLED_CELLS = 60  # cells from which the inks are measured


def count_missed_cells(
    image: NDArray[np.uint8], cells: Cells, numbering: Numbering, lattice: Lattice, scale: int
) -> int:
    """The number of cells not numbered that a finer scale might number, because they are small at this one.

    These are the places next to numbered cells that show the expected ink, and, if most cells are small, the cells
    without a number for which the layout has free cells.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        cells, numbering: the cells at full scale and their numbers.
        lattice: the layout.
        scale: full-scale pixels per pixel of the recognition.
    """
    small_px = float(SMALL_AREA_PX * scale * scale)
    return int(
        _count_missed(image, cells.center_px, cells.area_px, numbering.cell, lattice.layout_cells, small_px)
    )


@compiled
def _update_subtracting_gray(color):  # type: ignore[no-untyped-def]
    """Subtract the gray part (the least channel) from a color (3,); returns its strength."""
    color -= color.min()
    return np.sqrt(color[0] ** 2 + color[1] ** 2 + color[2] ** 2)


@compiled
def _count_missed(image, center_px, area_px, cell, layout, small_px):  # type: ignore[no-untyped-def]
    """The small cells without a number that may have a place, and the places that show their ink."""
    numbered = np.flatnonzero(cell >= 0)
    free, unnumbered = layout.ink.shape[0] - numbered.shape[0], cell.shape[0] - numbered.shape[0]
    if free == 0:
        return 0
    if unnumbered > 0 and np.median(area_px[numbered]) > small_px:
        unnumbered = 0
    visible = _count_visible_places(image, center_px, area_px, cell, numbered, layout, small_px)
    return min(unnumbered, free) + visible


@compiled
def _mean_ink_colors(image, center_px, area_px, cell, numbered, ink):  # type: ignore[no-untyped-def]
    """(4, 3) the inks' mean colors by some of the ``numbered`` cells, without gray, 0 for an absent ink; (4,) their
    strengths."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    mean, strength, color, count = np.zeros((4, 3)), np.zeros(4), np.zeros(3), np.zeros(4)
    every = max(1, numbered.shape[0] // MAX_SAMPLED_CELLS)
    every += every % 3 == 0  # along a row every third cell has the same ink
    for i in numbered[::every]:
        radius = SAMPLE_RADIUS * np.sqrt(area_px[i])
        if fill_patch_mean(flat, height, width, center_px[i, 0], center_px[i, 1], radius, color):
            for channel in range(3):
                mean[ink[cell[i]], channel] += color[channel]
            count[ink[cell[i]]] += 1.0
    for k in range(1, 4):
        mean[k] /= max(count[k], 1.0)
        strength[k] = _update_subtracting_gray(mean[k])
    return mean, strength


@compiled
def _cells_next_to_free(image_cell, cell, layout):  # type: ignore[no-untyped-def]
    """(N,) int32, the numbers of the cells next to free cells of the layout, else -1."""
    out = np.full(cell.shape[0], -1, np.int32)
    for v in range(image_cell.shape[0]):
        for k in range(6):
            u = layout.cell_neighbours[v, k]
            if image_cell[v] < 0 and u >= 0 and image_cell[u] >= 0:
                out[image_cell[u]] = u
    return out


@compiled
def _count_visible_places(image, center_px, area_px, cell, numbered, layout, small_px):  # type: ignore[no-untyped-def]
    """The number of places next to numbered cells, where cells are small, that show the expected ink."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    image_cell = image_cell_of_layout_cell(cell, layout.ink.shape[0])
    slope = linear_maps(center_px, _cells_next_to_free(image_cell, cell, layout), image_cell, layout)
    inks, strength = np.empty((0, 3)), np.empty(0)
    count, color = 0, np.zeros(3)
    for v in range(image_cell.shape[0]):
        if image_cell[v] >= 0:
            continue
        x, y, size, neighbours = 0.0, 0.0, 0.0, 0
        for k in range(6):
            u = layout.cell_neighbours[v, k]
            if u < 0 or image_cell[u] < 0 or np.isnan(slope[image_cell[u], 0, 0]):
                continue
            i = image_cell[u]
            dx = layout.center_mm[v, 0] - layout.center_mm[u, 0]
            dy = layout.center_mm[v, 1] - layout.center_mm[u, 1]
            x += center_px[i, 0] + slope[i, 0, 0] * dx + slope[i, 0, 1] * dy
            y += center_px[i, 1] + slope[i, 1, 0] * dx + slope[i, 1, 1] * dy
            size += area_px[i]
            neighbours += 1
        if neighbours == 0 or size > small_px * neighbours:
            continue
        if strength.shape[0] == 0:  # in most images no place needs the inks
            inks, strength = _mean_ink_colors(image, center_px, area_px, cell, numbered, layout.ink)
        expected, expected_strength = inks[layout.ink[v]], strength[layout.ink[v]]
        if expected_strength == 0.0:
            continue
        radius = SAMPLE_RADIUS * np.sqrt(size / neighbours)
        if not fill_patch_mean(flat, height, width, x / neighbours, y / neighbours, radius, color):
            continue
        shown = _update_subtracting_gray(color)
        product = color[0] * expected[0] + color[1] * expected[1] + color[2] * expected[2]
        is_strong = shown > MIN_STRENGTH_RATIO * expected_strength
        count += is_strong and product > MIN_COSINE * shown * expected_strength
    return count
