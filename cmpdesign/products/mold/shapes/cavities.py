"""Outlines of the cavities in the black layer: nominal where the camera sees them, wider at the open, hidden side.

            open side: the boss's root
      ______            ______          ____
            \\          /      |        |
     black   \\  red   /  black | white  | green
      ________\\______/________|________|____
        clear base layer, the camera below

The camera sees the base layer. A boss stands on the base layer with its tip, so its tip is the visible cell:
nominal except for the corners' radius. Walls lean outwards by the draft. Between two cavities that meet in a corner a
web stays at the open side, because corners are round. Between two that share a side, as the white cell and its
neighbours, the web is upright and has the width of the gap.

Where the web would be narrower than the gap (large draft, sharp corners), all cells are inset by the same width. On a
domed pad every outline lies within its flat facet, so cells are inset by half the gap at the open side, and also by the
draft.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout
from cmpdesign.products.mold.solids.loops import Loop, Points, inset_cells, inset_corners
from cmpdesign.products.mold.stack.stack import MoldStack

# Decimals of the common inset, mm, and the halvings of its bracket.
INSET_DECIMALS, HALVINGS = 6, 30


class Cavity(NamedTuple):
    """Outlines of a cavity in plan: at the base layer, where the camera sees it, and at the open side."""

    seen: Loop
    open: Loop


class _Sides(NamedTuple):
    """Insets of the sides of N cells with k corners, mm.

    Attributes:
        cells: (N, k, 2) corners in plan.
        seen: (N, k) insets at the base layer.
        draft: (N, k) growth from the base layer to the open side; 0 for upright walls.
    """

    cells: Points
    seen: NDArray[np.float64]
    draft: NDArray[np.float64]


def cavities(stack: MoldStack, color: int) -> list[Cavity]:
    """The cavities of a color's cells, in the layout's order."""
    sides = _sides(stack, stack.layout.cell_color[stack.layout.colored_cells] == color)
    radius, full = stack.options.tip_radius_mm, stack.draft_mm
    found = []
    even = (sides.draft == full).all(axis=1)
    seen = inset_cells(sides.cells, sides.seen, radius)
    opened = inset_cells(sides.cells, sides.seen - full, radius + full if radius else 0.0)
    for number, (tip, root) in enumerate(zip(seen, opened, strict=True)):
        if even[number]:
            found.append(Cavity(tip, root))
        else:
            chords = tip.with_chords()
            found.append(
                Cavity(
                    chords,
                    chords.offset_sides(_chord_drafts(chords, sides.cells[number], sides.draft[number])),
                )
            )
    return found


def open_insets(stack: MoldStack, color: int) -> NDArray[np.float64]:
    """(N, k) insets of the sides of a color's cavities at the open side, mm; negative where they widened."""
    sides = _sides(stack, stack.layout.cell_color[stack.layout.colored_cells] == color)
    return sides.seen - sides.draft


def seen_inset_mm(stack: MoldStack) -> float:
    """The inset of all cells at the base layer for which the webs at the open side have the width of the gap."""
    return _common_inset_mm(stack)


def web_mm(stack: MoldStack, inset_mm: float | None = None) -> float:
    """The least web at the open side between cavities that meet in a corner; infinite without such cavities."""
    import shapely

    pairs = _corner_pairs(stack.layout)
    if not len(pairs):
        return float("inf")
    inset = _common_inset_mm(stack) if inset_mm is None else inset_mm
    radius = stack.options.tip_radius_mm
    # A rounded cell is its core, dilated by the radius. A sharp cell is its own core.
    to_core = inset + radius if radius else inset - stack.draft_mm
    cells = stack.marker_xy_mm[stack.layout.cell_corners[stack.layout.colored_cells]]
    core = shapely.polygons(inset_corners(cells, np.full(cells.shape[:2], to_core)))
    distance = float(shapely.distance(core[pairs[:, 0]], core[pairs[:, 1]]).min())
    return distance - 2 * (radius + stack.draft_mm if radius else 0.0)


@lru_cache(maxsize=8)
def _common_inset_mm(stack: MoldStack) -> float:
    gap = stack.options.gap_mm
    if stack.crown is not None:
        return gap / 2 + stack.draft_mm
    if web_mm(stack, 0.0) >= gap:
        return 0.0
    low, high = 0.0, gap / 2 + stack.draft_mm
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if web_mm(stack, middle) >= gap else (middle, high)
    return float(np.ceil(high * 10**INSET_DECIMALS) / 10**INSET_DECIMALS)


def _sides(stack: MoldStack, which: NDArray[np.bool_]) -> _Sides:
    """The sides of the colored cells that a mask chooses."""
    layout = stack.layout
    shared = _shared_sides(layout)[which] & (stack.crown is None)
    cells = stack.marker_xy_mm[layout.cell_corners[layout.colored_cells[which]]]
    seen = np.where(shared, stack.options.gap_mm / 2, 0.0) + _common_inset_mm(stack)
    return _Sides(cells, seen, np.where(shared, 0.0, stack.draft_mm))


@lru_cache(maxsize=8)
def _shared_sides(layout: Layout) -> NDArray[np.bool_]:
    """(N, k) which side (from corner i to i + 1) of each colored cell is also a side of another colored cell."""
    corners = layout.cell_corners[layout.colored_cells].astype(np.int64)
    after = np.roll(corners, -1, axis=1)
    key = np.minimum(corners, after) * len(layout.marker_xy_mm) + np.maximum(corners, after)
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray(counts[inverse].reshape(key.shape) > 1)


@lru_cache(maxsize=8)
def _corner_pairs(layout: Layout) -> NDArray[np.int64]:
    """(P, 2) pairs of colored cells, by their number among these, that share one marker and no side."""
    at_marker: dict[int, list[int]] = {}
    for number, corners in enumerate(layout.cell_corners[layout.colored_cells].tolist()):
        for marker in corners:
            at_marker.setdefault(marker, []).append(number)
    counts: dict[tuple[int, int], int] = {}
    for cells in at_marker.values():
        for pair in combinations(cells, 2):
            counts[pair] = counts.get(pair, 0) + 1
    return np.array([pair for pair, count in counts.items() if count == 1], dtype=np.int64).reshape(-1, 2)


def _chord_drafts(chords: Loop, cell: Points, drafts: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) growth of every side of a chorded cell: along a rounded corner it changes evenly with the direction.

    Args:
        chords: the cell with chords at its corners.
        cell: (k, 2) corners of the cell, whose sides have the same directions.
        drafts: (k,) growth of the sides.
    """
    return np.interp(_directions(chords.points), _directions(cell), drafts, period=2 * np.pi)


def _directions(points: Points) -> NDArray[np.float64]:
    """(m,) direction of every side of a polygon, rad."""
    side = np.roll(points, -1, axis=0) - points
    return np.asarray(np.arctan2(side[:, 1], side[:, 0]))
