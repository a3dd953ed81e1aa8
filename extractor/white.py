"""Where the white cell stands: it fixes the turn and the origin of a numbering that is right up to these.

The white cell is a down-cell, one of those that are black elsewhere. So it is looked for where down-cells must be, in
the middle between three numbered cells first, and farther off only when it is not found there. It fills its triangle
and ends with it, which hardly any dirt or reflection on a black cell does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .batch import COLOR, INSIDE, POINTS, RADIUS, X, Y, room_for_samples, sample_patches
from .cells import Cells
from .engine import compiled
from .lattice import SIX, layer_of, marker_id, turned_place
from .tables import UNKNOWN, Lattice
from .whitecell import white_cell

# The middle of the white cell against the inks of the cells beside it, both as sums over the channels.
# Black stays below a half even in heavy blur; the white of a dim print is still brighter than any ink.
WHITE_RATIO = 0.75
# Between the inks it must be darker than they are, even in haze: in pictures of anything else it is not.
BLACK_RATIO = 0.95
BLACK_SHARE = 0.8  # of the places between three cells; the white cell and glare are among them
MIN_BETWEEN = 6  # such places; where they are fewer, those beside one or two cells count, too
SAME_WHITE = 0.6  # of the brightest; a squeezed black cell that blur has filled stays below
# White is, in light of any color, about as strong in every channel as the ink that has most of it; no dirt of one
# color is. The weakest channel so, and against the strongest.
MIN_WEAKEST = 0.5
MIN_BALANCE = 0.4
MAX_WHITES = 16
MIN_FAR = 0.75  # the weakest channel, where no walked cell touches it
MAX_OUTSIDE = 0.02  # of a part's cells, where it is put into the layout
# The down-cells around a cell (q, r), as steps to their own (q, r), the nearest first: three touch its sides.
STEPS = np.array([[q, r] for q in range(-4, 6) for r in range(-5, 5)], np.int32)
# From a cell's center to theirs, in axial steps, and in edges of an equilateral lattice.
STEP_REACH = 6
OFFSETS = STEPS + np.array([-2 / 3, 1 / 3])
DISTANCES = np.sqrt((OFFSETS**2).sum(axis=1) + OFFSETS[:, 0] * OFFSETS[:, 1])
# How far from the nearest numbered cell the white one is looked for; farther only when it is not found nearer.
WHITE_REACHES = (0.7, 1.7, 2.7, 3.7)
DISTANT = np.digitize(DISTANCES, WHITE_REACHES, right=True)
ORDER = np.argsort(DISTANT, kind="stable")
STEPS, OFFSETS = STEPS[ORDER], OFFSETS[ORDER]
RINGS = np.searchsorted(DISTANT[ORDER], np.arange(len(WHITE_REACHES) + 1))  # where in these each reach begins


class Way(NamedTuple):
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
    touching: bool


def ways_from_white(
    image: NDArray[np.uint8], cells: Cells, lattice: Lattice, at: NDArray[np.int32]
) -> list[Way]:
    """Every way to put the origin at a bright cell that leaves hardly any cell outside the layout.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        at: (N, 2) axial coordinates of the cells, up to turns and shifts; ``UNKNOWN`` for those not walked to.
    """
    center = cells.center_px
    known, basis = _bases(center, at)
    # more cells than the layout has do not fit into it anywhere
    if len(known) == 0 or len(known) - len(lattice.ink) > MAX_OUTSIDE * len(known):
        return []
    radius, level, inks, strongest = _shown(image, center, cells.area_px, cells.ink, known)
    layout = lattice.cell_of, lattice.layers, *lattice.white_place, lattice.center_mm
    seen = known, basis, radius, level
    ring, cell, inside, middle, mean, white = _searched(image, center, at, seen, inks, strongest, layout)
    fits = np.flatnonzero(inside)
    return [
        Way(cell[n], int(inside[n]), len(known) - int(inside[n]), middle[n], float(white[n]), ring == 0)
        for n in fits
        if mean[n] > SAME_WHITE * mean[fits[0]]
    ]


@compiled
def _searched(image, center, at, seen, inks, strongest, layout):  # type: ignore[no-untyped-def]
    """In which ring around the known cells the white one was found, and of each bright place there, the brightest
    first, what ``_tried`` tells and how bright and white it is.

    What three cells surround has been seen as well as it can be; it is not looked at again from farther off, nor is
    what was tried.
    """
    known = seen[0]
    grid = _axial_grid(at, known)
    closed, black = np.zeros(grid[2] * grid[3], np.bool_), np.empty(3)
    for ring in range(RINGS.shape[0] - 1):
        begin, end, far = RINGS[ring], RINGS[ring + 1], ring > 0
        sums = _foreseen(center, at, seen, STEPS[begin:end], OFFSETS[begin:end], grid)
        places, mean, white, votes, color = _colored(image, sums, closed, grid, strongest, far)
        if not far:
            if not _dark(mean, votes):
                break
            _between(color, votes, black)
            _close(closed, places[votes == 3], grid)
        bright = _brightest(mean, white, MIN_FAR if far else MIN_WEAKEST)
        if bright.shape[0] == 0:
            continue
        cell, inside, middle = _tried(image, center, at, known, places[bright], layout, inks, black)
        if inside.any():
            return ring, cell, inside, middle, mean[bright], white[bright]
        _close(closed, places[bright], grid)
    nothing = np.empty(0)
    return -1, np.empty((0, 0), np.int32), np.empty(0, np.int64), np.empty((0, 2)), nothing, nothing


@compiled
def _axial_grid(at, known):  # type: ignore[no-untyped-def]
    """The least axial q and r of a grid that holds all places which the known cells see, and its rows and columns."""
    low_q, low_r, high_q, high_r = 1 << 20, 1 << 20, -(1 << 20), -(1 << 20)
    for i in known:
        low_q, high_q = min(low_q, at[i, 0]), max(high_q, at[i, 0])
        low_r, high_r = min(low_r, at[i, 1]), max(high_r, at[i, 1])
    rows, columns = high_q - low_q + 2 * STEP_REACH + 1, high_r - low_r + 2 * STEP_REACH + 1
    return low_q - STEP_REACH, low_r - STEP_REACH, rows, columns


@compiled
def _close(closed, places, grid):  # type: ignore[no-untyped-def]
    """Mark places as not to be looked at again, in place."""
    for n in range(places.shape[0]):
        closed[(places[n, 0] - grid[0]) * grid[3] + places[n, 1] - grid[1]] = True


@compiled
def _between(color, votes, out):  # type: ignore[no-untyped-def]
    """Write the usual color of the places that the most cells surround."""
    among = color[votes == votes.max()]
    for channel in range(3):
        out[channel] = np.median(among[:, channel].copy())


@compiled
def _dark(brightness, votes):  # type: ignore[no-untyped-def]
    """Whether it is dark between the inks, as in the pattern; what lies beside a part of it may be anything."""
    every = np.count_nonzero(votes == 3) < MIN_BETWEEN
    between, dark = 0, 0
    for i in range(votes.shape[0]):
        if every or votes[i] == 3:
            between += 1
            dark += brightness[i] < BLACK_RATIO
    return between > 0 and dark / between >= BLACK_SHARE


@compiled
def _brightest(brightness, white, least):  # type: ignore[no-untyped-def]
    """The places bright enough that are at least so white, at most ``MAX_WHITES``, the brightest first."""
    bright = np.flatnonzero((brightness > WHITE_RATIO) & (white >= least))
    return bright[np.argsort(-brightness[bright], kind="mergesort")][:MAX_WHITES]


@compiled
def _bases(center, at):  # type: ignore[no-untyped-def]
    """(K,) the cells with a place and neighbours that say which way the lattice runs, and (K, 2, 2) how: the image step
    per axial step, by least squares over the six neighbours of each."""
    reach, found = 1, 0
    for i in range(at.shape[0]):
        if at[i, 0] != UNKNOWN:
            reach = max(reach, abs(at[i, 0]) + 1, abs(at[i, 1]) + 1)
    side = 2 * reach + 1
    holder = np.full((side, side), -1, np.int32)
    for i in range(center.shape[0]):
        if at[i, 0] != UNKNOWN:
            holder[at[i, 0] + reach, at[i, 1] + reach] = i
    known, basis = np.empty(center.shape[0], np.int64), np.empty((center.shape[0], 2, 2))
    for i in range(center.shape[0]):
        if at[i, 0] == UNKNOWN:
            continue
        nqq, nqr, nrr = 0.0, 0.0, 0.0
        xq, xr, yq, yr = 0.0, 0.0, 0.0, 0.0
        for k in range(6):
            dq, dr = SIX[k, 0], SIX[k, 1]
            q, r = at[i, 0] + dq + reach, at[i, 1] + dr + reach
            if holder[q, r] < 0:
                continue
            dx = center[holder[q, r], 0] - center[i, 0]
            dy = center[holder[q, r], 1] - center[i, 1]
            nqq += dq * dq
            nqr += dq * dr
            nrr += dr * dr
            xq += dx * dq
            xr += dx * dr
            yq += dy * dq
            yr += dy * dr
        determinant = nqq * nrr - nqr * nqr
        if determinant > 0.5:
            basis[found, 0, 0] = (xq * nrr - xr * nqr) / determinant
            basis[found, 0, 1] = (xr * nqq - xq * nqr) / determinant
            basis[found, 1, 0] = (yq * nrr - yr * nqr) / determinant
            basis[found, 1, 1] = (yr * nqq - yq * nqr) / determinant
            known[found] = i
            found += 1
    return known[:found], basis[:found]


@compiled
def _shown(image, center, area, ink, known):  # type: ignore[no-untyped-def]
    """(K,) px the radius over which each known cell's color is taken, (K,) its level, the sum over the channels, NaN
    outside the image; (4, 3) the inks' colors, 0 where there is none, and (3,) the most of each channel."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    radius, level = np.empty(known.shape[0]), np.full(known.shape[0], np.nan)
    colors, count = np.empty((4, 3, known.shape[0])), np.zeros(4, np.int64)
    room = room_for_samples()
    patches = room.patches
    for first in range(0, known.shape[0], POINTS):
        here = min(known.shape[0] - first, POINTS)
        for n in range(here):
            i = known[first + n]
            radius[first + n] = 0.1 * np.sqrt(area[i])
            patches[X + n], patches[Y + n], patches[RADIUS + n] = (
                center[i, 0],
                center[i, 1],
                radius[first + n],
            )
        sample_patches(flat, height, width, here, room)
        for n in range(here):
            if patches[INSIDE + n] > 0.0:
                own, total = ink[known[first + n]], 0.0
                for channel in range(3):
                    shown = patches[COLOR + channel * POINTS + n]
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
def _foreseen(center, at, seen, steps, offsets, grid):  # type: ignore[no-untyped-def]
    """(P, 5) of each place of the grid x, y, radius and level, summed over the known cells that see it at one of these
    steps, and the number of these."""
    low_q, low_r, rows, columns = grid
    known, basis, radius_of, level_of = seen
    sums = np.zeros((rows * columns, 5))
    way = np.empty(steps.shape[0], np.int64)
    for k in range(steps.shape[0]):
        way[k] = steps[k, 0] * columns + steps[k, 1]
    for n in range(known.shape[0]):
        i = known[n]
        if np.isnan(level_of[n]):
            continue
        x, y, radius, level = center[i, 0], center[i, 1], radius_of[n], level_of[n]
        a, b, c, d = basis[n, 0, 0], basis[n, 0, 1], basis[n, 1, 0], basis[n, 1, 1]
        here = (at[i, 0] - low_q) * columns + at[i, 1] - low_r
        for k in range(steps.shape[0]):
            to = np.uint64(here + way[k])
            sums[to, 0] += x + a * offsets[k, 0] + b * offsets[k, 1]
            sums[to, 1] += y + c * offsets[k, 0] + d * offsets[k, 1]
            sums[to, 2] += radius
            sums[to, 3] += level
            sums[to, 4] += 1.0
    return sums


@compiled
def _colored(image, sums, closed, grid, strongest, far):  # type: ignore[no-untyped-def]
    """The places that any cell sees and that are not closed: axial, brightness against the inks, how white, 0 where it
    is colored, how many cells tell, and (D, 3) their colors.

    Far from the next cell a prediction may hit a colored cell: there only the weakest channel tells.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    count = np.count_nonzero((sums[:, 4] > 0.0) & ~closed)
    places, seen = np.empty((count, 2), np.int32), np.zeros((count, 3))
    ratio, white, votes = np.zeros(count), np.zeros(count), np.zeros(count, np.int64)
    room, begin, found = room_for_samples(), 0, 0
    patches, level = room.patches, np.empty(POINTS)
    for place in range(sums.shape[0]):
        number = sums[place, 4]
        if number > 0.0 and not closed[place]:
            places[found, 0], places[found, 1] = place // grid[3] + grid[0], place % grid[3] + grid[1]
            votes[found] = int(number)
            n = found - begin
            patches[X + n], patches[Y + n] = sums[place, 0] / number, sums[place, 1] / number
            patches[RADIUS + n], level[n] = sums[place, 2] / number, sums[place, 3] / number
            found += 1
        if found - begin == POINTS or (place == sums.shape[0] - 1 and found > begin):
            sample_patches(flat, height, width, found - begin, room)
            for n in range(begin, found):
                ratio[n], white[n] = _judged(patches, n - begin, level[n - begin], strongest, far, seen[n])
            begin = found
    return places, ratio, white, votes, seen


@compiled
def _judged(patches, n, level, strongest, far, seen):  # type: ignore[no-untyped-def]
    """How bright a patch is against the inks around and how white; its color is written to ``seen``."""
    if not patches[INSIDE + n] > 0.0:
        return 0.0, 0.0
    total, weakest, most = 0.0, np.inf, 0.0
    for channel in range(3):
        seen[channel] = patches[COLOR + channel * POINTS + n]
        share = seen[channel] / max(strongest[channel], 1.0)
        total, weakest, most = total + seen[channel], min(weakest, share), max(most, share)
    white = weakest if weakest > MIN_BALANCE * most else 0.0
    return white if far else total / max(level, 1.0), white


@compiled
def _tried(image, center, at, known, places, layout, inks, black):  # type: ignore[no-untyped-def]
    """(P, N) int32 what ``_put`` makes of the known cells at each place, (P,) how many of them have one in the layout,
    and (P, 2) px the middle of the white cell: 0 and NaN where it is not there."""
    cell_of, layers, white_mm, to_mm, center_mm = layout
    cell, inside = np.empty((places.shape[0], at.shape[0]), np.int32), np.zeros(places.shape[0], np.int64)
    middle = np.full((places.shape[0], 2), np.nan)
    for n in range(places.shape[0]):
        count = _put(at, known, places[n], cell_of, layers, cell[n])
        if count > 0:
            middle[n] = white_cell(image, center, cell[n], white_mm, to_mm, center_mm, inks, black)
            inside[n] = 0 if np.isnan(middle[n, 0]) else count
    return cell, inside, middle


@compiled
def _put(at, known, place, cell_of, layers, out):  # type: ignore[no-untyped-def]
    """Write the layout's cell of each known cell, or -1, where a down-cell at the axial place is the white one; how
    many have one, 0 where too many have none.

    The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red is to
    the right, to the left or above, and a turn by 0, 120 or 240 degrees brings it to the right.
    """
    turn, outside = (place[0] - place[1]) % 3, 0
    out[:] = -1
    for i in known:
        q, r = turned_place(at[i, 0] - place[0] + turn, at[i, 1] - place[1], turn)
        if layer_of(q, r) <= layers:
            out[i] = cell_of[marker_id(q, r)]
        if out[i] < 0:
            outside += 1
            if outside > MAX_OUTSIDE * known.shape[0]:
                return 0
    return known.shape[0] - outside
