"""Stage 7: every cell gets its place in the lattice, and the white cell says where that lattice begins.

The spin search walks from face to face of the mesh, the inks checking every step: across an edge of two cells lies
the fourth of a rhombus, d = a + b - c, of the ink of c. So it numbers all that hangs together, from wherever it
starts, and finds another way around damage. What it finds so is right up to the turns by 120 degrees and the shifts
that carry every ink onto itself. The white cell then fixes turn and origin: it stands between one red, one green
and one blue cell, and these have their places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .engine import compiled
from .lattice import turned
from .mesh import Mesh
from .outline import settle
from .sampling import sample_patch
from .tables import UNKNOWN, Lattice, cells_at
from .types import Origin

# The middle of the white cell against the inks of the cells beside it, both as sums over the channels.
# Black stays below a half even in heavy blur; the white of a dim print is still brighter than any ink.
WHITE_RATIO = 0.75
# Between the inks it must be darker than they are, even in haze: in pictures of anything else it is not.
BLACK_RATIO = 0.95
BLACK_SHARE = 0.8  # of the places between inks; the white cell and glare are among them
SAME_WHITE = 0.6  # of the brightest; a squeezed black cell that blur has filled stays below
MIN_LEAD = 2  # cells by which the best reference must explain more than the next
MAX_WHITES = 8
MAX_PARTS = 4
# A part of the mesh is this pattern when it shows at least this share of its cells and puts hardly any outside.
MIN_EVIDENCE = 0.06
MIN_CELLS = 9  # or all, in a layout that has fewer
# Where the surface is seen nearly from the side the mesh falls to pieces that fit together by chance. So a part is also
# this share of what looks like a pattern at all, or this large.
MIN_SHARE = 0.4
SURE_CELLS = 30
MAX_OUTSIDE = 0.02
MAX_ROUNDS = 8
WITNESSES = 80  # faces that say which turn is that of the markers
# The down-cells around a cell (q, r), as steps to their own (q, r), the nearest first: three touch its sides.
STEPS = np.array([[q, r] for q in range(-4, 6) for r in range(-5, 5)], np.int32)
# From a cell's center to theirs, in axial steps, and in edges of an equilateral lattice.
STEP_REACH = 6
OFFSETS = STEPS + np.array([-2 / 3, 1 / 3])
DISTANCES = np.sqrt((OFFSETS**2).sum(axis=1) + OFFSETS[:, 0] * OFFSETS[:, 1])
# How far from the nearest numbered cell the white one is looked for; farther only when it is not found nearer.
WHITE_REACHES = (0.7, 1.7, 2.7, 3.7)
SIX = np.array([[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]], np.int32)


@dataclass(frozen=True, eq=False)
class Numbering:
    """Stage 7.

    Attributes:
        cell: (N,) int32, the lattice's colored cell that each cell of the image is, or -1.
        mirrored: the pattern is seen from its back.
        white_px: (2,) the middle of the white cell; of all cells where the outline told.
        conflicts: cells left out because their neighbours disagreed about them.
        ambiguous: two white cells could be the reference and nothing tells them apart.
        origin: what told where the lattice begins.
    """

    cell: NDArray[np.int32]
    mirrored: bool
    white_px: NDArray[np.float64]
    conflicts: int
    ambiguous: bool = False
    origin: Origin = Origin.WHITE


@compiled
def _walk(start, faces, neighbours, turn, front, blocked, reach):  # type: ignore[no-untyped-def]
    """Axial coordinates of all cells that hang together with one face, up to the lattice's own translations.

    ``front`` is the turn of the faces that are markers. Returns the coordinates and the cells contradicted.
    """
    count = blocked.shape[0]
    at = np.full((count, 2), UNKNOWN, np.int32)
    bad = np.zeros(count, np.bool_)
    side = 2 * reach + 1
    holder = np.full((side, side), -1, np.int32)
    queue = np.empty(faces.shape[0], np.int32)
    seen = np.zeros(faces.shape[0], np.bool_)
    # around marker (0, 0) red is (0, 0), green (0, -1), blue (-1, 0); around the white cell green is (-1, 1)
    for k in range(3):
        i = faces[start, k]
        at[i, 0] = 0 if k == 0 or (k == 1 and turn[start] == front) else -1
        at[i, 1] = 0 if k != 1 else (-1 if turn[start] == front else 1)
        holder[at[i, 0] + reach, at[i, 1] + reach] = i
    queue[0] = start
    seen[start] = True
    begin, end = 0, 1
    while begin < end:
        f = queue[begin]
        begin += 1
        for k in range(3):
            g = neighbours[f, k]
            if g < 0:
                continue
            a, b, c, d = faces[f, (k + 1) % 3], faces[f, (k + 2) % 3], faces[f, k], faces[g, k]
            if blocked[d]:
                continue
            q = at[a, 0] + at[b, 0] - at[c, 0]
            r = at[a, 1] + at[b, 1] - at[c, 1]
            if at[d, 0] == UNKNOWN:
                if abs(q) > reach or abs(r) > reach:
                    continue
                other = holder[q + reach, r + reach]
                if other >= 0:
                    bad[d] = True
                    bad[other] = True
                    continue
                at[d, 0], at[d, 1] = q, r
                holder[q + reach, r + reach] = d
            elif at[d, 0] != q or at[d, 1] != r:
                bad[d] = True
                continue
            if not seen[g]:
                seen[g] = True
                queue[end] = g
                end += 1
    return at, bad


@compiled
def _innermost(center, faces, members, blocked):  # type: ignore[no-untyped-def]
    """The sound face nearest to the middle of its part of the mesh, or -1: rims are often damaged."""
    x, y = 0.0, 0.0
    for f in members:
        for k in range(3):
            x += center[faces[f, k], 0]
            y += center[faces[f, k], 1]
    x, y = x / members.shape[0], y / members.shape[0]  # of sums over three, as below
    best, nearest = -1, np.inf
    for f in members:
        a, b, c = faces[f]
        if blocked[a] or blocked[b] or blocked[c]:
            continue
        dx = center[a, 0] + center[b, 0] + center[c, 0] - x
        dy = center[a, 1] + center[b, 1] + center[c, 1] - y
        if dx * dx + dy * dy < nearest:
            best, nearest = f, dx * dx + dy * dy
    return best


def _number_part(
    cells: Cells, mesh: Mesh, part: NDArray[np.intp], front: int, reach: int
) -> tuple[NDArray[np.int32], int]:
    """Walk a part of the mesh from its middle; cells that are contradicted are left out and it is walked again."""
    count = len(cells.ink)
    blocked = np.zeros(count, np.bool_)
    for _ in range(MAX_ROUNDS):
        start = _innermost(cells.center_px, mesh.faces, part, blocked)
        if start < 0:
            break
        at, bad = _walk(start, mesh.faces, mesh.neighbours, mesh.turn, front, blocked, reach)
        if not bad.any():
            return at, int(blocked.sum())
        blocked |= bad
    return np.full((count, 2), UNKNOWN, np.int32), int(blocked.sum())


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


def number(image: NDArray[np.uint8], cells: Cells, mesh: Mesh, lattice: Lattice) -> Numbering | None:
    """Stage 7: number the largest part of the mesh that holds a white cell or shows the whole outline; else None.

    Where several cells are as bright as white, the one that puts the most cells inside the layout and the fewest
    outside is the reference, unless two do so equally well: then nothing is reported.
    """
    found: list[tuple[int, Numbering]] = []
    parts = _largest_parts(mesh)
    least = _least_cells(mesh, lattice)
    for front in _fronts(image, cells, mesh):
        for part in parts:
            at, conflicts = _number_part(cells, mesh, part, front, 2 * lattice.layers + 2)
            found += _with_white(image, cells, lattice, at, front, conflicts, least)
            if not found:
                found += _with_outline(cells, lattice, at, front, conflicts)
    if not found:
        return None
    found.sort(key=lambda pair: -pair[0])
    score, best = found[0]
    reach = 0.5 * cells.edge_px
    rivals = [other for other, way in found if np.hypot(*(way.white_px - best.white_px)) > reach]
    return replace(best, ambiguous=bool(rivals) and score - max(rivals) < MIN_LEAD)


def _least_cells(mesh: Mesh, lattice: Lattice) -> float:
    """How many cells a part must explain to be believed."""
    meshed = np.count_nonzero(np.bincount(mesh.faces[mesh.turn != 0].reshape(-1)))
    of_layout = max(MIN_EVIDENCE * len(lattice.ink), min(MIN_CELLS, len(lattice.ink)))
    return max(of_layout, min(MIN_SHARE * meshed, SURE_CELLS))


def _with_outline(
    cells: Cells, lattice: Lattice, at: NDArray[np.int32], front: int, conflicts: int
) -> list[tuple[int, Numbering]]:
    """The way that the outline leaves, if it leaves only one."""
    known = np.flatnonzero(at[:, 0] != UNKNOWN)
    settled = settle(at[known], lattice)
    if settled is None:
        return []
    cell = np.full(len(at), -1, np.int32)
    cell[known] = settled
    middle = cells.center_px[known].mean(axis=0)
    return [(int((settled >= 0).sum()), Numbering(cell, front < 0, middle, conflicts, origin=Origin.OUTLINE))]


@compiled
def _brightness(image, center, faces, turn, every):  # type: ignore[no-untyped-def]
    """(F // every + 1, 2): the turn of every n-th face and its middle's brightness, NaN outside the image."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    out, color = np.full((turn.shape[0] // every + 1, 2), np.nan), np.zeros(3)
    number_of = 0
    for f in range(turn.shape[0]):
        if turn[f] == 0:
            continue
        number_of += 1
        if number_of % every != 0:
            continue
        x, y = 0.0, 0.0
        for k in range(3):
            x += center[faces[f, k], 0] / 3
            y += center[faces[f, k], 1] / 3
        nearest = np.inf
        for k in range(3):
            nearest = min(nearest, np.hypot(center[faces[f, k], 0] - x, center[faces[f, k], 1] - y))
        if sample_patch(flat, height, width, x, y, 0.12 * nearest, color):
            row = number_of // every - 1
            out[row, 0], out[row, 1] = turn[f], color.sum()
    return out


def _fronts(image: NDArray[np.uint8], cells: Cells, mesh: Mesh) -> list[int]:
    """The turn of the faces that are markers, the likelier first: black cells are darker than where cells meet."""
    every = max(1, int((mesh.turn != 0).sum()) // WITNESSES)
    turn, brightness = _brightness(image, cells.center_px, mesh.faces, mesh.turn, every).T
    plus, minus = brightness[turn == 1], brightness[turn == -1]
    if len(plus) < 4 or len(minus) < 4:
        return [1, -1]
    return [1] if np.median(plus) > np.median(minus) else [-1]


@compiled
def _parts(neighbours, turn):  # type: ignore[no-untyped-def]
    """(F,) the connected part of the mesh that each face belongs to, counted from 0; -1 for no face."""
    part = np.full(turn.shape[0], -1, np.int32)
    stack = np.empty(turn.shape[0], np.int32)
    count = 0
    for first in range(turn.shape[0]):
        if turn[first] == 0 or part[first] >= 0:
            continue
        part[first] = count
        stack[0], height = first, 1
        while height > 0:
            height -= 1
            f = stack[height]
            for k in range(3):
                g = neighbours[f, k]
                if g >= 0 and part[g] < 0:
                    part[g] = count
                    stack[height] = g
                    height += 1
        count += 1
    return part


def _largest_parts(mesh: Mesh) -> list[NDArray[np.intp]]:
    """The faces of each of the largest connected parts of the mesh."""
    part = _parts(mesh.neighbours, mesh.turn)
    sizes = np.bincount(part[part >= 0])
    return [np.flatnonzero(part == i) for i in np.argsort(-sizes, kind="stable")[:MAX_PARTS]]


def _with_white(
    image: NDArray[np.uint8],
    cells: Cells,
    lattice: Lattice,
    at: NDArray[np.int32],
    front: int,
    conflicts: int,
    least: float,
) -> list[tuple[int, Numbering]]:
    """Every way to put the origin at a bright cell that explains the least number of cells; and how many it does."""
    known = np.flatnonzero(at[:, 0] != UNKNOWN)
    basis = _bases(cells.center_px, at, 2 * lattice.layers + 2)[known]
    known = known[np.isfinite(basis[:, 0, 0])]
    basis = basis[np.isfinite(basis[:, 0, 0])]
    if len(known) == 0:
        return []
    for low, high in zip((0.0, *WHITE_REACHES), WHITE_REACHES, strict=False):
        steps = (low < DISTANCES) & (high >= DISTANCES)
        far = low >= WHITE_REACHES[0]
        tables = cells.center_px, cells.area_px, cells.ink, at, known, basis, STEPS[steps], OFFSETS[steps]
        places, where, mean = _whiteness(image, *tables, far)
        if low == 0.0 and np.mean(mean < BLACK_RATIO) < BLACK_SHARE:
            return []
        bright = np.flatnonzero(mean > max(WHITE_RATIO, SAME_WHITE * mean.max(initial=0.0)))
        if len(bright):
            break
    found = []
    for place in bright[np.argsort(-mean[bright], kind="stable")][:MAX_WHITES]:
        moved = np.full_like(at, UNKNOWN)
        moved[known] = _from_white(at[known], places[place])
        cell = cells_at(moved, lattice)
        inside = int((cell >= 0).sum())
        if inside < least or len(known) - inside > MAX_OUTSIDE * len(known):
            continue
        score = inside - 3 * (len(known) - inside) - conflicts
        found.append((score, Numbering(cell, front < 0, where[place], conflicts)))
    return found


@compiled
def _whiteness(image, center, area, ink, at, known, basis, steps, offsets, far):  # type: ignore[no-untyped-def]
    """The down-cells at these steps from numbered cells: axial places, (D, 2) px, and brightness against the inks.

    Far from the next cell a prediction may hit a colored cell. So there all three channels must be as strong as in
    the ink that has most of each: white is, in light of any color, and no ink is.
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
    for channel in range(3):
        for c in range(1, 4):
            if count[c] > 0:
                strongest[channel] = max(strongest[channel], np.median(colors[c, : count[c], channel]))
    found = int((sums[:, :, 4] > 0.0).sum())
    places, where, ratio = np.empty((found, 2), np.int32), np.empty((found, 2)), np.zeros(found)
    found = 0
    for q in range(rows):
        for r in range(columns):
            votes = sums[q, r, 4]
            if votes == 0.0:
                continue
            x, y, radius, level = sums[q, r, :4] / votes
            places[found, 0], places[found, 1] = q + low_q, r + low_r
            where[found, 0], where[found, 1] = x, y
            if sample_patch(flat, height, width, x, y, radius, own):
                if far:
                    ratio[found] = np.min(own / np.maximum(strongest, 1.0))
                else:
                    ratio[found] = own.sum() / max(level, 1.0)
            found += 1
    return places, where, ratio


def _from_white(at: NDArray[np.int32], white: NDArray[np.int32]) -> NDArray[np.int32]:
    """Axial coordinates turned and shifted so that a down-cell becomes (0, 0) with red to its right.

    The inks right of, above and left of a down-cell (q, r) are (q - r) mod 3 and the next two in turn. So red is to
    the right, to the left or above, and a turn by 0, 120 or 240 degrees brings it to the right.
    """
    turn = int(white[0] - white[1]) % 3
    return turned((at - white + np.array([turn, 0])).astype(np.int32), turn)
