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
from extractor.layout.lattice import rotated_cell
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
        white_px: (2,) the center of the white cell.
        white: its whiteness: its weakest channel, relative to the ink with most of that channel.
        white_adjacent: walked cells touch the white cell.
    """

    cell: NDArray[np.int32]
    inside: int
    outside: int
    white_px: NDArray[np.float64]
    white: float
    white_adjacent: bool


class _WhiteCandidates(NamedTuple):
    """P bright places, the brightest first.

    Attributes:
        ring: the ring around the known cells in which they were found, -1 if none was.
        cell: (P, N) int32, the layout's cell of each cell of the image, or -1.
        inside: (P,) int64, how many known cells lie in the layout; 0 where the white cell is not there.
        center_px: (P, 2) float64, the center of the white cell, NaN where it is not there.
        brightness, whiteness: (P,) float64.
    """

    ring: int
    cell: NDArray[np.int32]
    inside: NDArray[np.int64]
    center_px: NDArray[np.float64]
    brightness: NDArray[np.float64]
    whiteness: NDArray[np.float64]


def placements_by_white_cell(
    image: NDArray[np.uint8], cells: Cells, lattice: Lattice, axial: NDArray[np.int32]
) -> list[LayoutPlacement]:
    """All placements with the white cell at a bright place that leave hardly any cell outside the layout.

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
    fits = np.flatnonzero(found.inside)
    return [
        LayoutPlacement(
            found.cell[n],
            int(found.inside[n]),
            len(index) - int(found.inside[n]),
            found.center_px[n],
            float(found.whiteness[n]),
            found.ring == 0,
        )
        for n in fits
        if found.brightness[n] > MIN_RELATIVE_BRIGHTNESS * found.brightness[fits[0]]
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
        cell, inside, middle = _verify_placements(
            image, center, axial, known.cells, candidates, layout, inks.colors, black
        )
        if inside.any():
            brightness, whiteness = shown.brightness[bright], shown.whiteness[bright]
            return _WhiteCandidates(ring, cell, inside, middle, brightness, whiteness)
        update_excluded_places(grid, candidates)
    nothing = np.empty(0)
    return _WhiteCandidates(
        -1, np.empty((0, 0), np.int32), np.empty(0, np.int64), np.empty((0, 2)), nothing, nothing
    )


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
    """``cell``, ``inside`` and ``center_px`` of ``_WhiteCandidates`` at the axial ``places`` (P, 2)."""
    cell, inside = np.empty((places.shape[0], axial.shape[0]), np.int32), np.zeros(places.shape[0], np.int64)
    middle = np.full((places.shape[0], 2), np.nan)
    for n in range(places.shape[0]):
        count = _fill_placement(axial, known, places[n], layout.cell_lookup, cell[n])
        if count > 0:
            middle[n] = locate_white_cell(image, center, cell[n], layout, inks, black)
            inside[n] = 0 if np.isnan(middle[n, 0]) else count
    return cell, inside, middle


@compiled
def _fill_placement(axial, known, place, cell_lookup, out):  # type: ignore[no-untyped-def]
    """Number the known cells (K,) as if the down-cell at an axial place (2,) were the white cell.

    The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red is to
    the right, to the left or above, and a rotation by 0, 120 or 240 degrees brings it to the right.

    Args:
        axial: (N, 2) int32; cell_lookup: as ``Lattice.cell_lookup``.
        out: (N,) int32, receives the layout's cells, or -1.

    Returns:
        How many known cells lie in the layout; 0 if too many do not.
    """
    turn, outside = (place[0] - place[1]) % 3, 0
    out[:] = -1
    for i in known:
        q, r = rotated_cell(axial[i, 0] - place[0] + turn, axial[i, 1] - place[1], turn)
        out[i] = cell_at(cell_lookup, q, r)
        if out[i] < 0:
            outside += 1
            if outside > MAX_OUTSIDE_SHARE * known.shape[0]:
                return 0
    return known.shape[0] - outside
