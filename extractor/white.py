"""Where the white cell stands: it fixes the turn and the origin of a numbering that is right up to these.

The white cell is a down-cell, one of those that are black elsewhere. So it is looked for where down-cells must be, in
the middle between three numbered cells first, and farther off only when it is not found there. It fills its triangle
and ends with it, which hardly any dirt or reflection on a black cell does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .engine import compiled
from .lattice import SIX, turned
from .sampling import sample_patch
from .tables import UNKNOWN, Lattice, cells_at
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


class Way(NamedTuple):
    """A way to put the walked cells into the layout.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        outside: how many of the walked ones have no place in it.
        white_px: (2,) the middle of what would be the white cell.
        white: how white that is: its weakest channel, against the ink that has most of it.
        touching: cells beside the white one were walked to.
    """

    cell: NDArray[np.int32]
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
    known = np.flatnonzero(at[:, 0] != UNKNOWN)
    basis = _bases(cells.center_px, at, int(np.abs(at[known]).max(initial=0)) + 1)[known]
    whole = np.isfinite(basis[:, 0, 0])
    known, basis = known[whole], basis[whole]
    # more cells than the layout has do not fit into it anywhere
    if len(known) == 0 or len(known) - len(lattice.ink) > MAX_OUTSIDE * len(known):
        return []
    for low, high in zip((0.0, *WHITE_REACHES), WHITE_REACHES, strict=False):
        steps = (low < DISTANCES) & (high >= DISTANCES)
        far = low >= WHITE_REACHES[0]
        tables = cells.center_px, cells.area_px, cells.ink, at, known, basis, STEPS[steps], OFFSETS[steps]
        places, mean, white, votes, seen, inks = _whiteness(image, *tables, far)
        if low == 0.0 and not _dark(mean, votes):
            return []
        mean[white < (MIN_FAR if far else MIN_WEAKEST)] = 0.0
        bright = np.flatnonzero(mean > WHITE_RATIO)
        bright = bright[np.argsort(-mean[bright], kind="stable")][:MAX_WHITES]
        black = np.median(seen[votes == votes.max(initial=0)], axis=0)
        found: list[tuple[float, Way]] = []
        for place in bright:
            moved = np.full_like(at, UNKNOWN)
            moved[known] = _from_white(at[known], places[place])
            cell = cells_at(moved, lattice)
            outside = len(known) - int((cell >= 0).sum())
            if outside <= MAX_OUTSIDE * len(known):
                middle = white_cell(image, cells, cell, lattice, inks, black)
                if middle is not None:
                    found.append((mean[place], Way(cell, outside, middle, float(white[place]), not far)))
        if found:
            return [way for brightness, way in found if brightness > SAME_WHITE * found[0][0]]
    return []


def _dark(brightness: NDArray[np.float64], votes: NDArray[np.int64]) -> bool:
    """Whether it is dark between the inks, as in the pattern; what lies beside a part of it may be anything."""
    between = brightness[votes == 3]
    if len(between) < MIN_BETWEEN:
        between = brightness
    return float(np.mean(between < BLACK_RATIO)) >= BLACK_SHARE


@compiled
def _bases(center, at, reach):  # type: ignore[no-untyped-def]
    """(N, 2, 2) image step per axial step, by least squares over the six neighbours of each cell."""
    side = 2 * reach + 1
    holder = np.full((side, side), -1, np.int32)
    for i in range(center.shape[0]):
        if at[i, 0] != UNKNOWN:
            holder[at[i, 0] + reach, at[i, 1] + reach] = i
    basis = np.full((center.shape[0], 2, 2), np.nan)
    for i in range(center.shape[0]):
        if at[i, 0] == UNKNOWN:
            continue
        nqq, nqr, nrr = 0.0, 0.0, 0.0
        xq, xr, yq, yr = 0.0, 0.0, 0.0, 0.0
        for k in range(6):
            dq, dr = SIX[k, 0], SIX[k, 1]
            q, r = at[i, 0] + dq + reach, at[i, 1] + dr + reach
            if q < 0 or r < 0 or q >= side or r >= side or holder[q, r] < 0:
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
            basis[i, 0, 0] = (xq * nrr - xr * nqr) / determinant
            basis[i, 0, 1] = (xr * nqq - xq * nqr) / determinant
            basis[i, 1, 0] = (yq * nrr - yr * nqr) / determinant
            basis[i, 1, 1] = (yr * nqq - yq * nqr) / determinant
    return basis


@compiled
def _whiteness(image, center, area, ink, at, known, basis, steps, offsets, far):  # type: ignore[no-untyped-def]
    """The down-cells at these steps from numbered cells: axial places, brightness against the inks, how white, 0 where
    it is colored, how many cells tell, (D, 3) their colors; and (4, 3) those of the inks, 0 where there is none.

    Far from the next cell a prediction may hit a colored cell: there only the weakest channel tells.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    low_q, low_r, high_q, high_r = 1 << 20, 1 << 20, -(1 << 20), -(1 << 20)
    for i in known:
        low_q, high_q = min(low_q, at[i, 0]), max(high_q, at[i, 0])
        low_r, high_r = min(low_r, at[i, 1]), max(high_r, at[i, 1])
    low_q, low_r = low_q - STEP_REACH, low_r - STEP_REACH
    rows, columns = high_q + STEP_REACH - low_q + 1, high_r + STEP_REACH - low_r + 1
    # x, y, radius and level, summed over the cells that see the place, and their number
    sums = np.zeros((rows, columns, 5))
    own, strongest = np.empty(3), np.zeros(3)
    colors, count = np.full((4, known.shape[0], 3), np.nan), np.zeros(4, np.int64)
    for n in range(known.shape[0]):
        i = known[n]
        radius = 0.1 * np.sqrt(area[i])
        if not sample_patch(flat, height, width, center[i, 0], center[i, 1], radius, own):
            continue
        colors[ink[i], count[ink[i]]] = own
        count[ink[i]] += 1
        for k in range(steps.shape[0]):
            cell = sums[at[i, 0] + steps[k, 0] - low_q, at[i, 1] + steps[k, 1] - low_r]
            cell[0] += center[i, 0] + basis[n, 0, 0] * offsets[k, 0] + basis[n, 0, 1] * offsets[k, 1]
            cell[1] += center[i, 1] + basis[n, 1, 0] * offsets[k, 0] + basis[n, 1, 1] * offsets[k, 1]
            cell[2] += radius
            cell[3] += own.sum()
            cell[4] += 1.0
    inks = np.zeros((4, 3))
    for channel in range(3):
        for c in range(1, 4):
            if count[c] > 0:
                inks[c, channel] = np.median(colors[c, : count[c], channel])
                strongest[channel] = max(strongest[channel], inks[c, channel])
    found = int((sums[:, :, 4] > 0.0).sum())
    places, seen = np.empty((found, 2), np.int32), np.zeros((found, 3))
    ratio, white, seen_by = np.zeros(found), np.zeros(found), np.zeros(found, np.int64)
    found = 0
    for q in range(rows):
        for r in range(columns):
            votes = sums[q, r, 4]
            if votes == 0.0:
                continue
            seen_by[found] = int(votes)
            x, y, radius, level = sums[q, r, :4] / votes
            places[found, 0], places[found, 1] = q + low_q, r + low_r
            if sample_patch(flat, height, width, x, y, radius, own):
                brightness = own.sum() / max(level, 1.0)
                seen[found] = own
                own /= np.maximum(strongest, 1.0)
                if own.min() > MIN_BALANCE * own.max():
                    white[found] = own.min()
                ratio[found] = white[found] if far else brightness
            found += 1
    return places, ratio, white, seen_by, seen, inks


def _from_white(at: NDArray[np.int32], white: NDArray[np.int32]) -> NDArray[np.int32]:
    """Axial coordinates turned and shifted so that a down-cell becomes (0, 0) with red to its right.

    The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red is to
    the right, to the left or above, and a turn by 0, 120 or 240 degrees brings it to the right.
    """
    turn = int(white[0] - white[1]) % 3
    return turned((at - white + np.array([turn, 0])).astype(np.int32), turn)
