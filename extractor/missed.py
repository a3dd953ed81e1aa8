"""Whether recognition at a reduced scale has missed cells that the image shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .engine import compiled
from .gradients import gradients
from .lattice import SIX, layer_of, marker_id
from .numbering import Numbering
from .sampling import sample_patch
from .tables import Lattice

SMALL_AREA_PX = 30  # of a cell at the reduced scale; larger ones show all that they are
MIN_COSINE = 0.9  # between a color and the ink that should be there, grey taken off
MIN_STRENGTH = 0.4  # of the ink's strength
RADIUS = 0.12  # of the square root of a cell's area, over which colors are averaged


def missed(image: NDArray[np.uint8], cells: Cells, numbering: Numbering, lattice: Lattice, scale: int) -> int:
    """How many cells are not numbered, but might be at a finer scale, because they are small at this one.

    These are the places beside numbered cells where the ink shows that must be there, and cells without a number
    for which the layout has places left, should most be small.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        scale: by which it was reduced.
    """
    seen_as = np.full(len(lattice.ink), -1, np.int32)
    numbered = np.flatnonzero(numbering.cell >= 0)
    seen_as[numbering.cell[numbered]] = numbered
    free, loose = int((seen_as < 0).sum()), len(cells.ink) - len(numbered)
    small_px = float(SMALL_AREA_PX * scale * scale)
    if free == 0:
        return 0
    if np.median(cells.area_px[numbered]) > small_px:
        loose = 0
    slope = gradients(cells.center_px, numbering.cell, lattice)
    tables = lattice.ink, lattice.center_mm, lattice.axial, lattice.cell_of, lattice.layers
    shown = _missed(image, cells.center_px, cells.area_px, slope, seen_as, *tables, small_px)
    return min(loose, free) + int(shown)


@compiled
def _saturated(color):  # type: ignore[no-untyped-def]
    """Take the grey off a color, in place; its strength."""
    color -= color.min()
    return np.sqrt(color[0] ** 2 + color[1] ** 2 + color[2] ** 2)


@compiled
def _missed(image, center_px, area_px, slope, seen_as, ink, center_mm, axial, cell_of, layers, small_px):  # type: ignore[no-untyped-def]
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    usual, color, own = np.zeros((4, 3)), np.zeros(3), np.zeros(4)
    for u in range(ink.shape[0]):
        i = seen_as[u]
        if i >= 0:
            radius = RADIUS * np.sqrt(area_px[i])
            if sample_patch(flat, height, width, center_px[i, 0], center_px[i, 1], radius, color):
                usual[ink[u]] += color
                own[ink[u]] += 1.0
    strength = np.zeros(4)
    for k in range(1, 4):
        usual[k] /= max(own[k], 1.0)
        strength[k] = _saturated(usual[k])
    count = 0
    for v in range(ink.shape[0]):
        if seen_as[v] >= 0 or strength[ink[v]] == 0.0:
            continue
        x, y, size, witnesses = 0.0, 0.0, 0.0, 0
        for k in range(6):
            q, r = axial[v, 0] + SIX[k, 0], axial[v, 1] + SIX[k, 1]
            if layer_of(q, r) > layers:
                continue
            u = cell_of[marker_id(q, r)]
            if u < 0 or seen_as[u] < 0 or np.isnan(slope[seen_as[u], 0, 0]):
                continue
            i = seen_as[u]
            dx, dy = center_mm[v, 0] - center_mm[u, 0], center_mm[v, 1] - center_mm[u, 1]
            x += center_px[i, 0] + slope[i, 0, 0] * dx + slope[i, 0, 1] * dy
            y += center_px[i, 1] + slope[i, 1, 0] * dx + slope[i, 1, 1] * dy
            size += area_px[i]
            witnesses += 1
        if witnesses == 0 or size > small_px * witnesses:
            continue
        radius = RADIUS * np.sqrt(size / witnesses)
        if not sample_patch(flat, height, width, x / witnesses, y / witnesses, radius, color):
            continue
        shown, wanted = _saturated(color), usual[ink[v]]
        dot = color[0] * wanted[0] + color[1] * wanted[1] + color[2] * wanted[2]
        if shown > MIN_STRENGTH * strength[ink[v]] and dot > MIN_COSINE * shown * strength[ink[v]]:
            count += 1
    return count
