"""Stage 7: numbers the cells by their places in the lattice; the white cell gives the origin.

The spin search walks from face to face of the cell mesh; the inks check every step: across an edge (a, b) of a face
with the third cell c lies the fourth cell of a rhombus, d = a + b - c, which has the ink of c. The walk thus numbers
all connected cells, from any start, and around damage. The result is unique up to rotations by 120 degrees and
shifts that map every ink onto itself. The white cell then fixes rotation and origin: its neighbours are one red, one
green and one blue cell with known places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.layout.lattice_tables import Lattice
from extractor.numbering.mesh_parts import largest_components, marker_turns
from extractor.numbering.outline_fit import align_to_outline
from extractor.numbering.white_search import LayoutPlacement, placements_by_white_cell
from extractor.result import Origin, Reason

# cells, of the best reference over the next one in its component of the mesh; measured: rule "rivals"
MIN_SCORE_LEAD = 2
# neighbours that a second pad misses more than the best; an outline in view is many. Chosen
MAX_MORE_MISSING = 2
# A component of the mesh is this pattern if it shows this share of the pattern's cells and hardly any cell is outside.
MIN_LAYOUT_SHARE = 0.06
MIN_CELLS = 9  # least number of these cells, or all cells of a smaller layout; chosen
# At grazing view the mesh breaks into pieces that fit by chance. So a component also holds this share of the meshed
# cells, or this number.
MIN_MESH_SHARE = 0.4
SUFFICIENT_CELLS = 30
MAX_COMPONENTS = 12
MIN_COMPONENT_FACES = 5  # of a component whose white cell competes with another's; chosen


class WalkLimits(NamedTuple):
    """Limits of a walk.

    Attributes:
        max_rounds: walks of one component, each without the cells contradicted before; then it is given up. Measured:
            rule "contradictions".
    """

    max_rounds: int = 8


LIMITS = WalkLimits()


@dataclass(frozen=True, eq=False)
class Numbering:
    """Stage 7.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        mirrored: the pattern is seen from its back.
        white_px: (2,) float64, the center of the white cell; NaN if the outline gave the origin.
        conflicts: number of cells left out because their neighbours contradict each other.
        doubt: why the reference is not certain; None for a certain reference.
        origin: the evidence for the origin.
        white_adjacent: the white cell touches cells that were numbered from it.
    """

    cell: NDArray[np.int32]
    mirrored: bool
    white_px: NDArray[np.float64]
    conflicts: int
    doubt: Reason | None = None
    origin: Origin = Origin.WHITE
    white_adjacent: bool = True


class _WalkedComponent(NamedTuple):
    """A walked component of the mesh.

    Attributes:
        axial: (N, 2) int32, the cells' axial coordinates, ``UNKNOWN_AXIAL`` for cells not walked to.
        cells: number of the cells walked to; 0 if contradictions remain.
        conflicts: number of the cells left out.
        front: orientation of the faces that are markers.
        component: signed number of the component.
    """

    axial: NDArray[np.int32]
    cells: int
    conflicts: int
    front: int
    component: int


class _Candidate(NamedTuple):
    """A possible numbering.

    Attributes:
        inside: number of walked cells in the layout.
        score: ``inside`` minus penalties.
        missing: see ``LayoutPlacement``.
        fits: hardly any walked cell lies outside the layout.
        component: signed number of the component of the mesh.
        numbering: the numbering.
    """

    inside: int
    score: int
    missing: int
    fits: bool
    component: int
    numbering: Numbering


def max_walk_distance(lattice: Lattice) -> int:
    """The largest axial distance of a walk from its first cell: across the whole layout."""
    return 2 * lattice.layers + 2


def _walk_largest_components(
    cells: Cells, mesh: CellMesh, front: int, min_cells: float, reach: int
) -> list[_WalkedComponent]:
    """The large components of the mesh, walked from their middles, the largest first."""
    walks = []
    for number, component in enumerate(largest_components(mesh, MAX_COMPONENTS)):
        # k faces have at most k + 2 cells
        if len(component) < MIN_COMPONENT_FACES and len(component) + 2 < min_cells:
            break
        axial, walked, conflicts = native.walk_component(
            cells.center_px, mesh.faces, mesh.neighbours, mesh.orientation, component, front, reach, LIMITS
        )
        walks.append(_WalkedComponent(axial, walked, conflicts, front, front * (number + 1)))
    return walks


def number_cells(
    image: NDArray[np.uint8], cells: Cells, mesh: CellMesh, lattice: Lattice
) -> Numbering | None:
    """Stage 7: number the component of the mesh that contains the white cell or shows the whole outline.

    If several places of a component may be the white cell, the reference is the one with the most cells inside the
    layout and the fewest outside. The numbering is in doubt if that does not separate the candidates, or if another
    white cell has the surroundings of a reference, too.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        cells, mesh: the cells of the image, at full scale, and their mesh.
        lattice: the layout.

    Returns:
        The numbering; None without an origin.
    """
    min_cells, reach = _min_explained_cells(cells, mesh, lattice), max_walk_distance(lattice)
    walks = [
        walk
        for front in marker_turns(image, cells, mesh)
        for walk in _walk_largest_components(cells, mesh, front, min_cells, reach)
    ]
    found: list[_Candidate] = []
    no_white: list[_WalkedComponent] = []
    # a white cell explains at most the walked cells: with too few cells in every component no search is needed
    is_any_large = any(walk.cells >= min_cells for walk in walks)
    for walk in walks:
        placements = placements_by_white_cell(image, cells, lattice, walk.axial) if is_any_large else []
        own = [_score_placement(placement, walk) for placement in placements]
        found += own
        if not any(one.fits and one.inside >= min_cells for one in own):
            no_white.append(walk)
    best = _select_candidate(found, min_cells, 0.5 * cells.edge_px)
    for walk in no_white:
        # an outline with more cells than the white cell's component is more reliable
        if best is None or walk.cells > best.inside:
            best = _candidate_from_outline(lattice, walk) or best
    return best.numbering if best else None


def _select_candidate(found: list[_Candidate], min_cells: float, distance_px: float) -> _Candidate | None:
    """The best candidate that fits with at least ``min_cells`` cells inside.

    The candidate is in doubt if another candidate with the white cell farther away than ``distance_px`` is nearly as
    good.
    """
    large = [one for one in found if one.fits and one.inside >= min_cells]
    best = max(large, key=lambda one: one.score, default=None)
    if best is None:
        return None
    middle = best.numbering.white_px
    rivals = [
        one for one in found if one is not best and np.hypot(*(one.numbering.white_px - middle)) > distance_px
    ]
    doubt = _doubt(best, rivals, min_cells)
    return best if doubt is None else best._replace(numbering=replace(best.numbering, doubt=doubt))


def _doubt(best: _Candidate, rivals: list[_Candidate], min_cells: float) -> Reason | None:
    """The reason why the best candidate is not certain.

    A second candidate with the surroundings of a reference is a second pad: of its layout no more cells are missing in
    the image than of the best candidate's. A white place within a single pad misses the cells beyond the pad's outline,
    if the outline is in view.
    """
    others = [one for one in rivals if one.component != best.component and one.fits]
    beside = [one for one in rivals if one.component == best.component]
    if any(one.inside >= min_cells for one in others) or any(
        one.missing - best.missing <= MAX_MORE_MISSING for one in beside
    ):
        return Reason.SEVERAL_PADS
    if others or any(one.fits and best.score - one.score < MIN_SCORE_LEAD for one in beside):
        return Reason.AMBIGUOUS
    return None


def _min_explained_cells(cells: Cells, mesh: CellMesh, lattice: Lattice) -> float:
    """The least number of cells of a component that is accepted as the pattern."""
    meshed: int = native.count_meshed_cells(mesh.faces, mesh.orientation, len(cells.ink))
    of_layout = max(MIN_LAYOUT_SHARE * len(lattice.ink), min(MIN_CELLS, len(lattice.ink)))
    return max(of_layout, min(MIN_MESH_SHARE * meshed, SUFFICIENT_CELLS))


def _score_placement(placement: LayoutPlacement, walk: _WalkedComponent) -> _Candidate:
    """The candidate by a white cell."""
    inside, is_adjacent = placement.inside, placement.white_adjacent
    score = inside - 3 * placement.outside - walk.conflicts
    numbering = Numbering(
        placement.cell, walk.front < 0, placement.white_px, walk.conflicts, white_adjacent=is_adjacent
    )
    return _Candidate(
        inside,
        score,
        placement.missing,
        placement.fits,
        walk.component,
        numbering,
    )


def _candidate_from_outline(lattice: Lattice, walk: _WalkedComponent) -> _Candidate | None:
    """The candidate by the outline, if unique."""
    cell = align_to_outline(walk.axial, lattice)
    if cell is None:
        return None
    inside, nowhere = int(np.count_nonzero(cell >= 0)), np.full(2, np.nan)
    numbering = Numbering(cell, walk.front < 0, nowhere, walk.conflicts, origin=Origin.OUTLINE)
    return _Candidate(inside, inside, 0, True, 0, numbering)
