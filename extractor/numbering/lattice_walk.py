"""Stage 7: every cell gets its place in the lattice, and the white cell says where that lattice begins.

The spin search walks from face to face of the mesh, the inks checking every step: across an edge of two cells lies
the fourth of a rhombus, d = a + b - c, of the ink of c. So it numbers all that hangs together, from wherever it
starts, and finds another way around damage. What it finds so is right up to the turns by 120 degrees and the shifts
that carry every ink onto itself. The white cell then fixes turn and origin: it stands between one red, one green
and one blue cell, and these have their places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import UNKNOWN_AXIAL, Lattice
from extractor.numbering.mesh_parts import largest_components, marker_turns, most_central_face
from extractor.numbering.outline_fit import align_to_outline
from extractor.numbering.white_search import LayoutPlacement, placements_by_white_cell
from extractor.numeric.compilation import compiled
from extractor.result import Origin

MIN_SCORE_LEAD = (
    2  # cells by which the best reference must explain more than the next in its part of the mesh
)
MIN_RELATIVE_WHITENESS = 0.75  # of the whitest: what is less white is none, whatever it explains
# A part of the mesh is this pattern when it shows at least this share of its cells and puts hardly any outside.
MIN_LAYOUT_SHARE = 0.06
MIN_CELLS = 9  # or all, in a layout that has fewer
# Where the surface is seen nearly from the side the mesh falls to pieces that fit together by chance. So a part is also
# this share of what looks like a pattern at all, or this large.
MIN_MESH_SHARE = 0.4
SUFFICIENT_CELLS = 30
MAX_ROUNDS = 8
MAX_COMPONENTS = 12
MIN_COMPONENT_FACES = 5  # of a part whose white cell tells against another's


@dataclass(frozen=True, eq=False)
class Numbering:
    """Stage 7.

    Attributes:
        cell: (N,) int32, the lattice's colored cell that each cell of the image is, or -1.
        mirrored: the pattern is seen from its back.
        white_px: (2,) the middle of the white cell; NaN where the outline told.
        conflicts: cells left out because their neighbours disagreed about them.
        ambiguous: two white cells could be the reference and nothing tells them apart.
        origin: what told where the lattice begins.
        touching: the white cell touches what was numbered by it.
    """

    cell: NDArray[np.int32]
    mirrored: bool
    white_px: NDArray[np.float64]
    conflicts: int
    ambiguous: bool = False
    origin: Origin = Origin.WHITE
    white_adjacent: bool = True


class _WalkedComponent(NamedTuple):
    """A part of the mesh walked through: (N, 2) int32 the axial coordinates of the cells, ``UNKNOWN_AXIAL`` for
    those not
    walked to, the number of those that were and of those left out, the turn of its markers, and which part it is."""

    at: NDArray[np.int32]
    cells: int
    conflicts: int
    front: int
    part: int


class _Candidate(NamedTuple):
    """A numbering with what speaks for it: cells inside the layout, those less what speaks against it, how white the
    white cell is, which part of the mesh it is, and whether that touches the white cell."""

    inside: int
    score: int
    white: float
    part: int
    white_adjacent: bool
    numbering: Numbering


@compiled
def _walk_faces(start, faces, neighbours, turn, front, blocked, reach):  # type: ignore[no-untyped-def]
    """Axial coordinates of all cells that hang together with one face, up to the lattice's own translations.

    ``front`` is the turn of the faces that are markers. Returns the coordinates and the cells contradicted.
    """
    count = blocked.shape[0]
    at = np.full((count, 2), UNKNOWN_AXIAL, np.int32)
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
            if at[d, 0] == UNKNOWN_AXIAL:
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
def _walk_component(center, faces, neighbours, turn, part, front, reach):  # type: ignore[no-untyped-def]
    """Walk a part from its middle; cells that are contradicted are left out and it is walked again. The coordinates,
    ``UNKNOWN_AXIAL`` where that has no end, of how many cells they are, and how many cells were left out."""
    blocked = np.zeros(center.shape[0], np.bool_)
    for _ in range(MAX_ROUNDS):
        start = most_central_face(center, faces, part, blocked)
        if start < 0:
            break
        at, bad = _walk_faces(start, faces, neighbours, turn, front, blocked, reach)
        if not bad.any():
            return at, np.count_nonzero(at[:, 0] != UNKNOWN_AXIAL), np.count_nonzero(blocked)
        blocked |= bad
    return np.full((center.shape[0], 2), UNKNOWN_AXIAL, np.int32), 0, np.count_nonzero(blocked)


def max_walk_distance(lattice: Lattice) -> int:
    """How far from its first cell a walk may lead: across the whole layout."""
    return 2 * lattice.layers + 2


def _walk_largest_components(
    cells: Cells, mesh: CellMesh, front: int, least: float, reach: int
) -> list[_WalkedComponent]:
    """Every large part of the mesh, walked from its middle, the largest first."""
    walks = []
    for number_of, part in enumerate(largest_components(mesh, MAX_COMPONENTS)):
        if (
            len(part) < MIN_COMPONENT_FACES and len(part) + 2 < least
        ):  # so many faces have two cells more at most
            break
        at, walked, conflicts = _walk_component(
            cells.center_px, mesh.faces, mesh.neighbours, mesh.orientation, part, front, reach
        )
        walks.append(_WalkedComponent(at, walked, conflicts, front, front * (number_of + 1)))
    return walks


def number_cells(
    image: NDArray[np.uint8], cells: Cells, mesh: CellMesh, lattice: Lattice
) -> Numbering | None:
    """Stage 7: number the part of the mesh that holds the white cell or shows the whole outline; else None.

    Where several cells of a part could be the white one, the one that puts the most cells inside the layout and the
    fewest outside is the reference, unless two do so equally well. Where parts disagree, the whiter cell is, unless
    one is as white as the other. What is not settled so is ambiguous.
    """
    least, reach = _min_explained_cells(cells, mesh, lattice), max_walk_distance(lattice)
    walks = [
        walk
        for front in marker_turns(image, cells, mesh)
        for walk in _walk_largest_components(cells, mesh, front, least, reach)
    ]
    found: list[_Candidate] = []
    no_white: list[_WalkedComponent] = []
    # a white cell explains no more cells than were walked to: where these are too few in every part, none tells
    telling = any(walk.cells >= least for walk in walks)
    for walk in walks:
        ways = placements_by_white_cell(image, cells, lattice, walk.at) if telling else []
        own = [_score_placement(way, walk) for way in ways]
        found += own
        if not any(one.inside >= least for one in own):
            no_white.append(walk)
    best = _select_candidate(found, least, 0.5 * cells.edge_px)
    for walk in no_white:
        # with more cells than the white cell's part has, the outline tells more
        if best is None or walk.cells > best.inside:
            best = _candidate_from_outline(lattice, walk) or best
    return best.numbering if best else None


def _select_candidate(found: list[_Candidate], least: float, apart_px: float) -> _Candidate | None:
    """The best candidate that explains the least number of cells; ambiguous where any that puts the white cell
    elsewhere is nearly as good."""
    white = MIN_RELATIVE_WHITENESS * max((one.white for one in found), default=0.0)
    found = [one for one in found if one.white >= white]
    large = [one for one in found if one.inside >= least]
    best = max(large, key=lambda one: (one.white_adjacent, one.score), default=None)
    if best is None:
        return None
    middle = best.numbering.white_px
    rivals = [
        one for one in found if one is not best and np.hypot(*(one.numbering.white_px - middle)) > apart_px
    ]
    if any(one.part != best.part or best.score - one.score < MIN_SCORE_LEAD for one in rivals):
        return best._replace(numbering=replace(best.numbering, ambiguous=True))
    return best


@compiled
def _count_meshed_cells(faces, turn, count):  # type: ignore[no-untyped-def]
    """How many of the cells have a face."""
    has = np.zeros(count, np.bool_)
    for f in range(turn.shape[0]):
        if turn[f] != 0:
            for k in range(3):
                has[faces[f, k]] = True
    return np.count_nonzero(has)


def _min_explained_cells(cells: Cells, mesh: CellMesh, lattice: Lattice) -> float:
    """How many cells a part must explain to be believed."""
    meshed = int(_count_meshed_cells(mesh.faces, mesh.orientation, len(cells.ink)))
    of_layout = max(MIN_LAYOUT_SHARE * len(lattice.ink), min(MIN_CELLS, len(lattice.ink)))
    return max(of_layout, min(MIN_MESH_SHARE * meshed, SUFFICIENT_CELLS))


def _score_placement(way: LayoutPlacement, walk: _WalkedComponent) -> _Candidate:
    score = way.inside - 3 * way.outside - walk.conflicts
    numbering = Numbering(
        way.cell, walk.front < 0, way.white_px, walk.conflicts, white_adjacent=way.white_adjacent
    )
    return _Candidate(way.inside, score, way.white, walk.part, way.white_adjacent, numbering)


def _candidate_from_outline(lattice: Lattice, walk: _WalkedComponent) -> _Candidate | None:
    """The way that the outline leaves, if it leaves only one."""
    cell = align_to_outline(walk.at, lattice)
    if cell is None:
        return None
    inside, nowhere = int(np.count_nonzero(cell >= 0)), np.full(2, np.nan)
    numbering = Numbering(cell, walk.front < 0, nowhere, walk.conflicts, origin=Origin.OUTLINE)
    return _Candidate(inside, inside, 0.0, 0, False, numbering)
