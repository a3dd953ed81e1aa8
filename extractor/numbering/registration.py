"""Stage 7: registers connected parts of cells with the layout.

What is unknown of a part is a motion: one of three turns, and a shift. All motions are scored by all witnesses: cells
outside the layout, the naming of the inks, and the white cell's place. The part's motion is accepted if its lead
over the second best is large. All other parts, a single cell being the smallest, are then registered against
the placed ones by a smooth local map and their inks. A cell without a certain place has no number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.image.pyramid import PyramidLevel
from extractor.layout.lattice_tables import Lattice
from extractor.numbering.ink_fields import InkFields, Palette, ink_fields
from extractor.numbering.lattice_walk import Walk, WalkedCells, seen_from
from extractor.result import Origin, Reason

MIN_LAYOUT_SHARE = 0.06  # of the layout's cells, of a part that gives the origin; chosen
MIN_CELLS = 9  # least number of these cells, or all cells of a smaller layout; chosen
MAX_PARTS = 4  # that are tried for the origin, the largest; chosen
NAMING_WEIGHT = 8.0  # log odds for one unit of the naming; chosen
SIDE_LEAD = 0.6  # of the naming of the other side over that of the stated one, to be refused; chosen
LEAD = 6.0  # log odds of the best motion over the second best; chosen


class WitnessLimits(NamedTuple):
    """Weights of the witnesses of a part's motion.

    Attributes:
        outside_weight: log odds against a motion for each cell outside the layout. Chosen.
        max_outside_share: of a part's cells outside the layout. Chosen.
        min_outside: cells outside the layout that any part may have. Chosen.
        trimmed_share: of a part's cells at each end, without which it fits into the layout. Chosen.
        max_motions: the best motions, that are looked at. Chosen.
    """

    outside_weight: float = 3.0
    max_outside_share: float = 0.1
    min_outside: int = 3
    trimmed_share: float = 0.03
    max_motions: int = 60


class WhiteLimits(NamedTuple):
    """The witness of the white cell.

    Attributes:
        bright: whiteness of a down-cell that is not black. Chosen.
        dark: whiteness of a black cell; blurred and milky black stays below. Chosen.
        white_is_bright: probability that the white cell is bright. Chosen.
        white_is_dark: log odds against a dark place. Chosen.
    """

    bright: float = 0.6
    dark: float = 0.3
    white_is_bright: float = 0.9
    white_is_dark: float = -3.0


class MapPrior(NamedTuple):
    """The prior of local maps; lengths in edges.

    Attributes:
        noise: standard deviation of a cell's center. Chosen.
        curvature: of half a second derivative, per edge. Chosen.
        unseen: of the terms beyond, of the cube of the distance from the nearest known cell. Chosen.
    """

    noise: float = 0.06
    curvature: float = 0.04
    unseen: float = 0.012


class AttachmentLimits(NamedTuple):
    """Limits of parts that are registered against placed ones.

    Attributes:
        prior: of the map.
        known_cells: placed cells through which a map goes. Chosen.
        judged_cells: cells of a part by which its motion is judged, those nearest to placed ones. Chosen.
        max_rounds: passes over all parts. Chosen.
        reach: in edges, of the places that are tried for a cell, beyond the nearest. Derived: the next places of
            the lattice.
        max_corner_misfit: in edges, between a cell's corners and those of the map; a triangle that points the other way
            has 1.15. Chosen.
        max_misfit: mean log likelihood of a cell of an accepted part. Chosen.
        outside_odds: log likelihood of a cell that lies outside, on a taken place, or nowhere near. Chosen.
        margin: lead of the best motion. Chosen.
    """

    prior: MapPrior = MapPrior()
    known_cells: int = 12
    judged_cells: int = 16
    max_rounds: int = 6
    reach: float = 1.8
    max_corner_misfit: float = 0.6
    max_misfit: float = 4.5
    outside_odds: float = -12.5
    margin: float = 6.0


WITNESSES = WitnessLimits()
WHITE = WhiteLimits()
ATTACHMENT = AttachmentLimits()


class RegisteredLayout(NamedTuple):
    """The layout as native loops take it.

    Attributes:
        axial: (U, 2) int32, of the colored cells.
        cell_lookup: (S, S) int32, as ``Lattice.cell_lookup``.
    """

    axial: NDArray[np.int32]
    cell_lookup: NDArray[np.int32]


class Motions(NamedTuple):
    """The best motions of a part, the best first.

    Attributes:
        motion: (K, 3) int32, turn, and shifts of q and r.
        score: (K,) float64, log odds.
        inside: (K,) int64, number of cells in the layout.
        white: (K,) float64, the log odds of the white place alone.
    """

    motion: NDArray[np.int32]
    score: NDArray[np.float64]
    inside: NDArray[np.int64]
    white: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Numbering:
    """Stage 7.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        mirrored: the pattern is seen from its back.
        origin: the evidence for the origin.
        lead: log odds of the motion of the first part over the second best.
        fields: the colors around the first part.
    """

    cell: NDArray[np.int32]
    mirrored: bool
    origin: Origin
    lead: float
    fields: InkFields


@dataclass(frozen=True, eq=False)
class Refusal:
    """Why no cell is numbered.

    Attributes:
        reason: the reason.
        fields: the colors around the largest part, if there is one.
    """

    reason: Reason
    fields: InkFields | None = None


class _Placed(NamedTuple):
    """A part with its motions."""

    part: int
    cells: WalkedCells
    fields: InkFields
    motions: Motions
    mirrored: bool

    @property
    def lead(self) -> float:
        scores = self.motions.score
        return float(scores[0] - scores[1]) if len(scores) > 1 else np.inf

    @property
    def is_certain(self) -> bool:
        return len(self.motions.score) > 0 and self.lead >= LEAD


class Registration:
    """Registers the cells of images with one layout.

    Args:
        lattice: the layout.
        palette: its inks.
        mirrored: whether images show the back; None where both sides are read.
    """

    def __init__(self, lattice: Lattice, palette: Palette, mirrored: bool | None) -> None:
        self._lattice = lattice
        self._palette = palette
        self._mirrored = mirrored
        self._layout = RegisteredLayout(lattice.axial, lattice.cell_lookup)
        self.min_cells = max(MIN_LAYOUT_SHARE * len(lattice.ink), min(MIN_CELLS, len(lattice.ink)))

    def number(self, view: PyramidLevel, cells: Cells, mesh: CellMesh, walk: Walk) -> Numbering | Refusal:
        """The numbers of the cells, or the reason why there are none.

        Args:
            view: the image at the scale of recognition.
            cells, mesh, walk: the cells of the image, their links, and their places in the lattice.
        """
        sizes = walk.sizes
        large = [int(p) for p in np.argsort(-sizes, kind="stable")[:MAX_PARTS] if sizes[p] >= self.min_cells]
        if not large:
            return Refusal(Reason.NO_PATTERN)
        refusal: Refusal | None = None
        for n, part in enumerate(large):
            placed = self._register(view, cells, mesh, walk, part)
            if isinstance(placed, Refusal):
                refusal = refusal or placed
            elif placed.is_certain:
                return self._attach(view, cells, mesh, walk, placed, large[:n] + large[n + 1 :])
            else:
                refusal = refusal or Refusal(_uncertain_reason(placed), placed.fields)
        assert refusal is not None
        return refusal

    def _register(
        self, view: PyramidLevel, cells: Cells, mesh: CellMesh, walk: Walk, part: int
    ) -> _Placed | Refusal:
        """A part with its motions, or the reason why its side is refused."""
        mirrored = bool(self._mirrored)
        walked = seen_from(cells, mesh, walk, mirrored)
        fields = ink_fields(view, walked, part)
        own, other = self._palette.naming(fields.shares), self._palette.naming(fields.shares, other_side=True)
        lead = float(other.max() - own.max())
        if self._mirrored is None and lead > 0.0:
            mirrored = not mirrored
            walked = seen_from(cells, mesh, walk, mirrored)
            fields = ink_fields(view, walked, part)
            own = self._palette.naming(fields.shares)
        if lead > SIDE_LEAD and self._mirrored is not None or self._mirrored is None and abs(lead) < SIDE_LEAD:
            return Refusal(Reason.OTHER_SIDE, fields)
        naming = NAMING_WEIGHT * (own - own.max())
        white = white_odds(fields.whiteness)
        axial = np.ascontiguousarray(walked.axial[walked.part == part])
        found = native.register_part(axial, naming, fields.down_axial, white, self._layout, WITNESSES)
        return _Placed(part, walked, fields, Motions(*found), mirrored)

    def _attach(
        self,
        view: PyramidLevel,
        cells: Cells,
        mesh: CellMesh,
        walk: Walk,
        placed: _Placed,
        others: list[int],
    ) -> Numbering | Refusal:
        """The numbers of all cells, by the part that is placed."""
        own = placed.cells.part == placed.part
        axial = np.ascontiguousarray(placed.cells.axial[own])
        turn, dq, dr = (int(v) for v in placed.motions.motion[0])
        cell = np.full(len(own), -1, np.int32)
        cell[own] = native.moved_cells(axial, turn, dq, dr, self._layout.cell_lookup)
        shift = _class_shift(self._lattice, cell[own], axial)
        odds = np.ascontiguousarray(placed.fields.odds[:, (np.arange(3) - shift) % 3])
        cell = native.attach_parts(
            placed.cells, cell, odds, self._lattice.layout_cells, *self._layout, ATTACHMENT
        )
        for part in others:
            if (cell[walk.part == part] >= 0).any():
                continue
            second = self._register(view, cells, mesh, walk, part)
            if not isinstance(second, Refusal) and second.is_certain and second.motions.white[0] > 0.0:
                return Refusal(Reason.SEVERAL_PADS, placed.fields)
        origin = Origin.WHITE if placed.motions.white[0] > 0.0 else Origin.OUTLINE
        return Numbering(cell, placed.mirrored, origin, placed.lead, placed.fields)


def white_odds(whiteness: NDArray[np.float64]) -> NDArray[np.float64]:
    """(D,) log odds that a down-cell of this whiteness (D,) is the white one over a black one; NaN is unknown.

    How often a black cell is bright is seen in the image itself: glare, dirt and scratches are bright, too.
    """
    known = np.isfinite(whiteness)
    bright = known & (whiteness > WHITE.bright)
    others = max(int(bright.sum()) - 1, 0)
    is_bright = np.log(WHITE.white_is_bright * (known.sum() + 1.0) / (others + 0.5))
    dark = known & (whiteness < WHITE.dark)
    return np.where(known, np.where(bright, is_bright, np.where(dark, WHITE.white_is_dark, 0.0)), np.nan)


def _uncertain_reason(placed: _Placed) -> Reason:
    """Why a part has no certain motion."""
    white = placed.motions.white
    close = placed.motions.score > placed.motions.score[0] - LEAD if len(white) else np.zeros(0, bool)
    return Reason.AMBIGUOUS if np.count_nonzero(white[close] > 0.0) > 1 else Reason.REFERENCE_LOST


def _class_shift(lattice: Lattice, cell: NDArray[np.int32], axial: NDArray[np.int32]) -> int:
    """By which a motion shifts the classes (q - r) mod 3."""
    first = int(np.argmax(cell >= 0))
    q, r = lattice.axial[cell[first]]
    return int((q - r - axial[first, 0] + axial[first, 1]) % 3)
