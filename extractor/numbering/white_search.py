"""Where the white cell stands: it fixes the turn and the origin of a numbering that is right up to these.

The white cell is a down-cell, one of those that are black elsewhere. So it is looked for where down-cells must be, in
the middle between three numbered cells first, and farther off only when it is not found there. It fills its triangle
and ends with it, which hardly any dirt or reflection on a black cell does.
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
from extractor.numbering.white_cell import locate_white_cell
from extractor.numeric.bilinear_batch import (
    BATCH_POINTS,
    COLOR,
    INSIDE,
    RADIUS,
    X,
    Y,
    allocate_sample_buffers,
    fill_patch_means,
)
from extractor.numeric.compilation import compiled

# The middle of the white cell against the inks of the cells beside it, both as sums over the channels.
# Black stays below a half even in heavy blur; the white of a dim print is still brighter than any ink.
MIN_WHITE_RATIO = 0.75
# Between the inks it must be darker than they are, even in haze: in pictures of anything else it is not.
MAX_BLACK_RATIO = 0.95
MIN_BLACK_SHARE = 0.8  # of the places between three cells; the white cell and glare are among them
MIN_ENCLOSED_PLACES = 6  # such places; where they are fewer, those beside one or two cells count, too
MIN_RELATIVE_BRIGHTNESS = 0.6  # of the brightest; a squeezed black cell that blur has filled stays below
# White is, in light of any color, about as strong in every channel as the ink that has most of it; no dirt of one
# color is. The weakest channel so, and against the strongest.
MIN_WEAKEST_CHANNEL = 0.5
MIN_CHANNEL_BALANCE = 0.4
MAX_WHITE_CANDIDATES = 16
MIN_WEAKEST_CHANNEL_FAR = 0.75  # the weakest channel, where no walked cell touches it


class LayoutPlacement(NamedTuple):
    """A way to put the walked cells into the layout.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        inside, outside: how many of the walked ones have a place in it, and how many have none.
        white_px: (2,) the middle of what would be the white cell.
        white: how white that is: its weakest channel, against the ink that has most of it.
        touching: cells beside the white one were walked to.
    """

    cell: NDArray[np.int32]
    inside: int
    outside: int
    white_px: NDArray[np.float64]
    white: float
    white_adjacent: bool


def placements_by_white_cell(
    image: NDArray[np.uint8], cells: Cells, lattice: Lattice, at: NDArray[np.int32]
) -> list[LayoutPlacement]:
    """Every way to put the origin at a bright cell that leaves hardly any cell outside the layout.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        at: (N, 2) axial coordinates of the cells, up to turns and shifts; ``UNKNOWN`` for those not walked to.
    """
    center = cells.center_px
    known, basis = lattice_bases(center, at)
    # more cells than the layout has do not fit into it anywhere
    if len(known) == 0 or len(known) - len(lattice.ink) > MAX_OUTSIDE_SHARE * len(known):
        return []
    radius, level, inks, strongest = _measure_inks(image, center, cells.area_px, cells.ink, known)
    layout = lattice.layers, lattice.cell_lookup, *lattice.white_cell_frame, lattice.center_mm
    seen = known, basis, radius, level
    ring, cell, inside, middle, mean, white = _search_white_cell(
        image, center, at, seen, inks, strongest, layout
    )
    fits = np.flatnonzero(inside)
    return [
        LayoutPlacement(
            cell[n], int(inside[n]), len(known) - int(inside[n]), middle[n], float(white[n]), ring == 0
        )
        for n in fits
        if mean[n] > MIN_RELATIVE_BRIGHTNESS * mean[fits[0]]
    ]


@compiled
def _search_white_cell(image, center, at, seen, inks, strongest, layout):  # type: ignore[no-untyped-def]
    """In which ring around the known cells the white one was found, and of each bright place there, the brightest
    first, what ``_verify_placements`` tells and how bright and white it is.

    What three cells surround has been seen as well as it can be; it is not looked at again from farther off, nor is
    what was tried.
    """
    known, layers = seen[0], layout[0]
    grid, black = build_axial_grid(at, known, seen[3]), np.empty(3)
    for ring in range(RING_STARTS.shape[0] - 1):
        far = ring > 0
        if ring == 1:
            update_excluded_misfits(grid, at, known, layers)
        places, means, votes = predicted_places(center, seen, grid, ring)
        mean, white, color = _measure_whiteness(image, means, strongest, far)
        if not far:
            if not _is_dark_between_inks(mean, votes):
                break
            _fill_black_color(color, votes, black)
            update_excluded_places(grid, places[votes == 3])
        bright = _select_brightest(mean, white, MIN_WEAKEST_CHANNEL_FAR if far else MIN_WEAKEST_CHANNEL)
        if bright.shape[0] == 0:
            continue
        cell, inside, middle = _verify_placements(
            image, center, at, known, places[bright], layout[1:], inks, black
        )
        if inside.any():
            return ring, cell, inside, middle, mean[bright], white[bright]
        update_excluded_places(grid, places[bright])
    nothing = np.empty(0)
    return -1, np.empty((0, 0), np.int32), np.empty(0, np.int64), np.empty((0, 2)), nothing, nothing


@compiled
def _fill_black_color(color, votes, out):  # type: ignore[no-untyped-def]
    """Write the usual color of the places that the most cells surround."""
    among = color[votes == votes.max()]
    for channel in range(3):
        out[channel] = np.median(among[:, channel].copy())


@compiled
def _is_dark_between_inks(brightness, votes):  # type: ignore[no-untyped-def]
    """Whether it is dark between the inks, as in the pattern; what lies beside a part of it may be anything."""
    every = np.count_nonzero(votes == 3) < MIN_ENCLOSED_PLACES
    between, dark = 0, 0
    for i in range(votes.shape[0]):
        if every or votes[i] == 3:
            between += 1
            dark += brightness[i] < MAX_BLACK_RATIO
    return between > 0 and dark / between >= MIN_BLACK_SHARE


@compiled
def _select_brightest(brightness, white, least):  # type: ignore[no-untyped-def]
    """The places bright enough that are at least so white, at most ``MAX_WHITE_CANDIDATES``, the brightest first."""
    bright = np.flatnonzero((brightness > MIN_WHITE_RATIO) & (white >= least))
    return bright[np.argsort(-brightness[bright], kind="mergesort")][:MAX_WHITE_CANDIDATES]


@compiled
def _measure_inks(image, center, area, ink, known):  # type: ignore[no-untyped-def]
    """(K,) px the radius over which each known cell's color is taken, (K,) its level, the sum over the channels, NaN
    outside the image; (4, 3) the inks' colors, 0 where there is none, and (3,) the most of each channel."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    radius, level = np.empty(known.shape[0]), np.full(known.shape[0], np.nan)
    colors, count = np.empty((4, 3, known.shape[0])), np.zeros(4, np.int64)
    room = allocate_sample_buffers()
    patches = room.patches
    for first in range(0, known.shape[0], BATCH_POINTS):
        here = min(known.shape[0] - first, BATCH_POINTS)
        for n in range(here):
            i = known[first + n]
            radius[first + n] = 0.1 * np.sqrt(area[i])
            patches[X + n], patches[Y + n], patches[RADIUS + n] = (
                center[i, 0],
                center[i, 1],
                radius[first + n],
            )
        fill_patch_means(flat, height, width, here, room)
        for n in range(here):
            if patches[INSIDE + n] > 0.0:
                own, total = ink[known[first + n]], 0.0
                for channel in range(3):
                    shown = patches[COLOR + channel * BATCH_POINTS + n]
                    colors[own, channel, count[own]] = shown
                    total += shown
                count[own] += 1
                level[first + n] = total
    inks, strongest = np.zeros((4, 3)), np.zeros(3)
    for channel in range(3):
        for c in range(1, 4):
            if count[c] > 0:
                inks[c, channel] = np.median(colors[c, channel, : count[c]])
                strongest[channel] = max(strongest[channel], inks[c, channel])
    return radius, level, inks, strongest


@compiled
def _measure_whiteness(image, means, strongest, far):  # type: ignore[no-untyped-def]
    """Of foreseen places (P, 4) the brightness against the inks, how white, 0 where it is colored, and (P, 3) their
    colors.

    Far from the next cell a prediction may hit a colored cell: there only the weakest channel tells.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    count = means.shape[0]
    ratio, white, seen = np.zeros(count), np.zeros(count), np.zeros((count, 3))
    room = allocate_sample_buffers()
    patches = room.patches
    for first in range(0, count, BATCH_POINTS):
        here = min(count - first, BATCH_POINTS)
        for n in range(here):
            patches[X + n], patches[Y + n] = means[first + n, 0], means[first + n, 1]
            patches[RADIUS + n] = means[first + n, 2]
        fill_patch_means(flat, height, width, here, room)
        for n in range(here):
            level, own = means[first + n, 3], seen[first + n]
            ratio[first + n], white[first + n] = _fill_patch_color(patches, n, level, strongest, far, own)
    return ratio, white, seen


@compiled
def _fill_patch_color(patches, n, level, strongest, far, seen):  # type: ignore[no-untyped-def]
    """How bright a patch is against the inks around and how white; its color is written to ``seen``."""
    if not patches[INSIDE + n] > 0.0:
        return 0.0, 0.0
    total, weakest, most = 0.0, np.inf, 0.0
    for channel in range(3):
        seen[channel] = patches[COLOR + channel * BATCH_POINTS + n]
        share = seen[channel] / max(strongest[channel], 1.0)
        total, weakest, most = total + seen[channel], min(weakest, share), max(most, share)
    white = weakest if weakest > MIN_CHANNEL_BALANCE * most else 0.0
    return white if far else total / max(level, 1.0), white


@compiled
def _verify_placements(image, center, at, known, places, layout, inks, black):  # type: ignore[no-untyped-def]
    """(P, N) int32 what ``_fill_placement`` makes of the known cells at each place, (P,) how many of them have one
    in the layout,
    and (P, 2) px the middle of the white cell: 0 and NaN where it is not there."""
    holder, white_mm, to_mm, center_mm = layout
    cell, inside = np.empty((places.shape[0], at.shape[0]), np.int32), np.zeros(places.shape[0], np.int64)
    middle = np.full((places.shape[0], 2), np.nan)
    for n in range(places.shape[0]):
        count = _fill_placement(at, known, places[n], holder, cell[n])
        if count > 0:
            middle[n] = locate_white_cell(image, center, cell[n], white_mm, to_mm, center_mm, inks, black)
            inside[n] = 0 if np.isnan(middle[n, 0]) else count
    return cell, inside, middle


@compiled
def _fill_placement(at, known, place, holder, out):  # type: ignore[no-untyped-def]
    """Write the layout's cell of each known cell, or -1, where a down-cell at the axial place is the white one; how
    many have one, 0 where too many have none.

    The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red is to
    the right, to the left or above, and a turn by 0, 120 or 240 degrees brings it to the right.
    """
    turn, outside = (place[0] - place[1]) % 3, 0
    out[:] = -1
    for i in known:
        q, r = rotated_cell(at[i, 0] - place[0] + turn, at[i, 1] - place[1], turn)
        out[i] = cell_at(holder, q, r)
        if out[i] < 0:
            outside += 1
            if outside > MAX_OUTSIDE_SHARE * known.shape[0]:
                return 0
    return known.shape[0] - outside
