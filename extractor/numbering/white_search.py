"""Searches the white cell, which fixes the rotation and the origin of a numbering.

The white cell is a down-cell; all other down-cells are black. So it is searched where down-cells are predicted: first
in the middle between three numbered cells, and farther away only if it is not found there. The white cell fills its
triangle and ends with it, which hardly any dirt or reflection on a black cell does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.layout.lattice import NEIGHBOUR_STEPS, rotated_cell
from extractor.layout.lattice_tables import Lattice, cell_at
from extractor.localmap.cell_prediction import (
    MAX_OUTSIDE_SHARE,
    RING_STARTS,
    build_axial_grid,
    lattice_bases,
    predicted_places,
    update_excluded_misfits,
    update_excluded_places,
)
from extractor.numbering.white_cell import WhiteCellLayout, locate_white_cell
from extractor.numbering.whiteness import measure_inks, measure_whiteness
from extractor.numeric.compilation import compiled

# Brightness is the sum of the channels, relative to that of the inks around.
MIN_WHITE_RATIO = 0.75  # of white; blurred black stays below 0.5, dim white is brighter than any ink
MAX_BLACK_RATIO = 0.95  # between the inks: black is darker than the inks even in haze, other images are not
MIN_BLACK_SHARE = 0.8  # of the places between three cells; the white cell and glare are among these places
MIN_ENCLOSED_PLACES = 6  # such places; if fewer, places next to one or two cells count, too
MIN_RELATIVE_BRIGHTNESS = 0.6  # of the brightest; a compressed black cell filled by blur stays below
MIN_WEAKEST_CHANNEL = 0.5  # least whiteness
MAX_WHITE_CANDIDATES = 16
MIN_WEAKEST_CHANNEL_FAR = 0.75  # the same where no walked cell touches the place


class LayoutPlacement(NamedTuple):
    """A way to place the walked cells in the layout.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        inside, outside: how many walked cells lie in the layout, and how many do not.
        missing: how often a neighbour of a walked cell lies in the layout and in the image, but was not found.
        fits: hardly any walked cell lies outside the layout.
        white_px: (2,) the center of the white cell.
        white: its whiteness: its weakest channel, relative to the ink with most of that channel.
        white_adjacent: walked cells touch the white cell.
    """

    cell: NDArray[np.int32]
    inside: int
    outside: int
    missing: int
    fits: bool
    white_px: NDArray[np.float64]
    white: float
    white_adjacent: bool


class _WhiteCandidates(NamedTuple):
    """P bright places, the brightest first.

    Attributes:
        ring: the ring around the known cells in which they were found, -1 if none was.
        cell: (P, N) int32, the layout's cell of each cell of the image, or -1.
        inside: (P,) int64, how many known cells lie in the layout; 0 where the white cell is not there.
        missing: (P,) int64, see ``LayoutPlacement``.
        center_px: (P, 2) float64, the center of the white cell, NaN where it is not there.
        brightness, whiteness: (P,) float64.
    """

    ring: int
    cell: NDArray[np.int32]
    inside: NDArray[np.int64]
    missing: NDArray[np.int64]
    center_px: NDArray[np.float64]
    brightness: NDArray[np.float64]
    whiteness: NDArray[np.float64]


def placements_by_white_cell(
    image: NDArray[np.uint8], cells: Cells, lattice: Lattice, axial: NDArray[np.int32]
) -> list[LayoutPlacement]:
    """All placements with the white cell at a bright place; one of them leaves hardly any cell outside the layout.

    The others are white cells, too, but the walked cells are not this layout around them.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        cells: the cells of the image.
        lattice: the layout.
        axial: (N, 2) int32, the cells' axial coordinates, up to rotations and translations; ``UNKNOWN_AXIAL`` for cells
            not walked to.
    """
    center = cells.center_px
    index, basis = lattice_bases(center, axial)
    # more cells than the layout has do not fit anywhere
    if len(index) == 0 or len(index) - len(lattice.ink) > MAX_OUTSIDE_SHARE * len(index):
        return []
    known, inks = measure_inks(image, center, cells.area_px, cells.ink, index, basis)
    layout = WhiteCellLayout(
        lattice.layers, lattice.cell_lookup, *lattice.white_cell_frame, lattice.center_mm
    )
    found = _search_white_cell(image, center, axial, known, inks, layout)
    is_fit = _fits(found.inside, len(index))
    brightest = found.brightness[is_fit].max(initial=0.0)
    return [
        LayoutPlacement(
            found.cell[n],
            int(found.inside[n]),
            len(index) - int(found.inside[n]),
            int(found.missing[n]),
            bool(is_fit[n]),
            found.center_px[n],
            float(found.whiteness[n]),
            found.ring == 0,
        )
        for n in np.flatnonzero(found.inside)
        if found.brightness[n] > MIN_RELATIVE_BRIGHTNESS * brightest
    ]


@compiled
def _search_white_cell(image, center, axial, known, inks, layout):  # type: ignore[no-untyped-def]
    """The ``_WhiteCandidates`` of the first ring that holds the white cell.

    Places enclosed by three cells are measured as well as possible in ring 0: they are not measured again from farther
    away, nor are the places that were tried.

    Args:
        image: (H, W, 3) uint8; center: (N, 2) px; axial: (N, 2) int32.
        known: ``KnownCells``. inks: ``InkColors``. layout: ``WhiteCellLayout``.
    """
    grid, black = build_axial_grid(axial, known.cells, known.level), np.empty(3)
    for ring in range(RING_STARTS.shape[0] - 1):
        is_far = ring > 0
        if ring == 1:
            update_excluded_misfits(grid, axial, known.cells, layout.layers)
        places = predicted_places(center, known, grid, ring)
        shown = measure_whiteness(image, places.means, inks.strongest, is_far)
        if not is_far:
            if not _is_dark_between_inks(shown.brightness, places.support_count):
                break
            _fill_black_color(shown.color, places.support_count, black)
            update_excluded_places(grid, places.axial[places.support_count == 3])
        least = MIN_WEAKEST_CHANNEL_FAR if is_far else MIN_WEAKEST_CHANNEL
        bright = _select_brightest(shown.brightness, shown.whiteness, least)
        if bright.shape[0] == 0:
            continue
        candidates = places.axial[bright]
        cell, inside, missing, middle = _verify_placements(
            image, center, axial, known.cells, candidates, layout, inks.colors, black
        )
        if _fits(inside, known.cells.shape[0]).any():
            brightness, whiteness = shown.brightness[bright], shown.whiteness[bright]
            return _WhiteCandidates(ring, cell, inside, missing, middle, brightness, whiteness)
        update_excluded_places(grid, candidates)
    nothing, none = np.empty(0), np.empty(0, np.int64)
    return _WhiteCandidates(-1, np.empty((0, 0), np.int32), none, none, np.empty((0, 2)), nothing, nothing)


@compiled
def _fits(inside, count):  # type: ignore[no-untyped-def]
    """(P,) bool, whether hardly any of ``count`` known cells lies outside the layout."""
    return (inside > 0) & (count - inside <= MAX_OUTSIDE_SHARE * count)


@compiled
def _fill_black_color(color, support_count, out):  # type: ignore[no-untyped-def]
    """Write the median color (3,) of the places predicted by the most cells."""
    enclosed = color[support_count == support_count.max()]
    for channel in range(3):
        out[channel] = np.median(enclosed[:, channel].copy())


@compiled
def _is_dark_between_inks(brightness, support_count):  # type: ignore[no-untyped-def]
    """Whether the places between the inks are dark, as in the pattern; places outside the pattern do not count."""
    use_all = np.count_nonzero(support_count == 3) < MIN_ENCLOSED_PLACES
    between, dark = 0, 0
    for i in range(support_count.shape[0]):
        if use_all or support_count[i] == 3:
            between += 1
            dark += brightness[i] < MAX_BLACK_RATIO
    return between > 0 and dark / between >= MIN_BLACK_SHARE


@compiled
def _select_brightest(brightness, whiteness, least):  # type: ignore[no-untyped-def]
    """The bright places of at least this whiteness, the brightest first, at most ``MAX_WHITE_CANDIDATES``."""
    bright = np.flatnonzero((brightness > MIN_WHITE_RATIO) & (whiteness >= least))
    return bright[np.argsort(-brightness[bright], kind="mergesort")][:MAX_WHITE_CANDIDATES]


@compiled
def _verify_placements(image, center, axial, known, places, layout, inks, black):  # type: ignore[no-untyped-def]
    """``cell``, ``inside``, ``missing`` and ``center_px`` of ``_WhiteCandidates`` at the axial ``places`` (P, 2)."""
    cell, inside = np.empty((places.shape[0], axial.shape[0]), np.int32), np.zeros(places.shape[0], np.int64)
    missing, middle = np.zeros(places.shape[0], np.int64), np.full((places.shape[0], 2), np.nan)
    walked, first = _walked_lookup(axial, known)
    for n in range(places.shape[0]):
        count = _fill_placement(axial, known, places[n], layout.cell_lookup, cell[n])
        middle[n] = locate_white_cell(image, center, cell[n], layout, inks, black)
        if not np.isnan(middle[n, 0]):
            inside[n] = count
            missing[n] = _count_missing(
                image.shape, center, axial, known, places[n], layout.cell_lookup, walked, first
            )
    return cell, inside, missing, middle


@compiled
def _placed(q, r, place):  # type: ignore[no-untyped-def]
    """The layout's axial (q, r) of the image's, if the down-cell at an axial place (2,) is the white cell.

    The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red is to
    the right, to the left or above, and a rotation by 0, 120 or 240 degrees brings it to the right.
    """
    turn = (place[0] - place[1]) % 3
    return rotated_cell(q - place[0] + turn, r - place[1], turn)


@compiled
def _fill_placement(axial, known, place, cell_lookup, out):  # type: ignore[no-untyped-def]
    """Number the known cells (K,) as if the down-cell at an axial place (2,) were the white cell.

    Args:
        axial: (N, 2) int32; cell_lookup: as ``Lattice.cell_lookup``.
        out: (N,) int32, receives the layout's cells, or -1.

    Returns:
        How many known cells lie in the layout.
    """
    inside = 0
    out[:] = -1
    for i in known:
        q, r = _placed(axial[i, 0], axial[i, 1], place)
        out[i] = cell_at(cell_lookup, q, r)
        inside += out[i] >= 0
    return inside


@compiled
def _walked_lookup(axial, known):  # type: ignore[no-untyped-def]
    """(S, T) int32, the known cell at each axial place relative to the first (2,), or -1; with a rim of -1."""
    first = np.array([axial[known, 0].min() - 1, axial[known, 1].min() - 1])
    lookup = np.full(
        (axial[known, 0].max() - first[0] + 2, axial[known, 1].max() - first[1] + 2), -1, np.int32
    )
    for i in known:
        lookup[axial[i, 0] - first[0], axial[i, 1] - first[1]] = i
    return lookup, first


@compiled
def _count_missing(shape, center, axial, known, place, cell_lookup, walked, first):  # type: ignore[no-untyped-def]
    """How often a neighbour of a known cell lies in the layout and in the image, but is not known.

    Its center is extrapolated from the cell and the one opposite; it counts a step away from the image's border.

    Args:
        shape: of the image. center: (N, 2) px. axial: (N, 2) int32. known: (K,). place: (2,) of the white cell.
        cell_lookup: as ``Lattice.cell_lookup``. walked, first: of ``_walked_lookup``.
    """
    missing = 0
    for i in known:
        q, r = _placed(axial[i, 0], axial[i, 1], place)
        if cell_at(cell_lookup, q, r) < 0:
            continue
        u, v = axial[i, 0] - first[0], axial[i, 1] - first[1]
        for k in range(NEIGHBOUR_STEPS.shape[0]):
            du, dv = NEIGHBOUR_STEPS[k, 0], NEIGHBOUR_STEPS[k, 1]
            opposite = walked[u - du, v - dv]
            if walked[u + du, v + dv] >= 0 or opposite < 0:
                continue
            q, r = _placed(axial[i, 0] + du, axial[i, 1] + dv, place)
            if cell_at(cell_lookup, q, r) < 0:
                continue
            dx, dy = center[i, 0] - center[opposite, 0], center[i, 1] - center[opposite, 1]
            x, y, margin = center[i, 0] + dx, center[i, 1] + dy, np.hypot(dx, dy)
            missing += x > margin and y > margin and x < shape[1] - margin and y < shape[0] - margin
    return missing
