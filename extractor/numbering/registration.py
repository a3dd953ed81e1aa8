"""Stage 7: registers connected parts of cells with the layout.

What is unknown of a part is a motion: one of three turns, and a shift. All motions are scored by all witnesses: cells
outside the layout, the naming of the inks, and the white cell's place, or the bits of a code. The part's motion is
accepted if its lead over the second best is large. All other parts, a single cell being the smallest, are then
registered against the placed ones by a smooth local map and their inks. A cell without a certain place has no number.
Of a family of pads that differ in their codes alone, the pad is unknown, too: one more part of a motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.cells.cell_mesh import CellMesh
from extractor.cells.cells import Cells
from extractor.image.pyramid import PyramidLevel
from extractor.layout.lattice_tables import Lattice, cells_at
from extractor.numbering.code_bits import Agreement, CodeBits
from extractor.numbering.ink_fields import InkFields, Palette, ink_fields
from extractor.numbering.joined_parts import joined_to
from extractor.numbering.lattice_walk import Walk, WalkedCells, seen_from
from extractor.numbering.witnesses import (
    BrightPlaces,
)
from extractor.result import Origin, Reason

MIN_LAYOUT_SHARE = 0.06  # of the layout's cells, of a part that gives the origin; chosen
MIN_CELLS = 9  # least number of these cells, or all cells of a smaller layout; chosen
MAX_PARTS = 4  # that are tried for the origin, the largest; chosen
NAMING_WEIGHT = 8.0  # log odds for one unit of the naming; chosen
MIN_FIT = 0.75  # of the colors of the three classes; tilings of other inks have half. Chosen
SIDE_LEAD = 0.6  # of the naming of the other side over that of the stated one, to be refused; chosen
MAX_TIED = 60  # motions between which the other parts may decide; chosen, for time
OTHER_WHITE = 6.0  # log odds against a motion with a white triangle at a black cell; chosen
LEAD = 8.0  # log odds of the best motion over the second best; chosen
JOINT_LEAD = 45.0  # the same where other parts decide: 15 cells; they are not independent. Chosen
MIN_NUMBERED_SHARE = 0.5  # of the cells of large parts; with fewer, all motions are compared. Chosen


class RegisteredLayout(NamedTuple):
    """The layouts of a family as native loops take them.

    Attributes:
        axial: (U, 2) int32, of the colored cells.
        white_axial: (W, 2) int32, of the white down-cells of all pads.
        white_pad: (W,) int32, the pad of each, in ascending order.
        cell_lookup: (S, S) int32, as ``Lattice.cell_lookup``.
    """

    axial: NDArray[np.int32]
    white_axial: NDArray[np.int32]
    white_pad: NDArray[np.int32]
    cell_lookup: NDArray[np.int32]


class Motions(NamedTuple):
    """The best motions of a part, the best first.

    Attributes:
        motion: (K, 3) int32, turn, and shifts of q and r.
        pad: (K,) int32, the pad of a family.
        score: (K,) float64, log odds.
        white: (K,) float64, the log odds of the white places alone.
        known_white: (K,) int32, the number of the known ones of these.
        rival_without_white: the best score of all motions of the part but the first, without their white places.
        compared: number of all motions of the part.
    """

    motion: NDArray[np.int32]
    pad: NDArray[np.int32]
    score: NDArray[np.float64]
    white: NDArray[np.float64]
    known_white: NDArray[np.int32]
    rival_without_white: float
    compared: int

    def chosen(self, order: NDArray[np.intp], score: NDArray[np.float64]) -> Motions:
        """Some of the motions, with other scores."""
        return self._replace(
            motion=self.motion[order],
            pad=self.pad[order],
            score=score,
            white=self.white[order],
            known_white=self.known_white[order],
        )


@dataclass(frozen=True, eq=False)
class Numbering:
    """Stage 7.

    Attributes:
        cell: (N,) int32, the layout's cell of each cell of the image, or -1.
        pad: number of the pad in its family.
        mirrored: the pattern is seen from its back.
        origin: the evidence for the origin.
        lead: log odds of the motion of the first part over the second best.
        fields: the colors around the first part.
        code_misfit: share of the known bits of a code that are wrong in the first part; 0 without a code.
    """

    cell: NDArray[np.int32]
    pad: int
    mirrored: bool
    origin: Origin
    lead: float
    fields: InkFields
    code_misfit: float = 0.0


@dataclass(frozen=True, eq=False)
class Refusal:
    """Why no cell is numbered.

    Attributes:
        reason: the reason.
        fields: the colors around the largest part, if there is one.
    """

    reason: Reason
    fields: InkFields | None = None


class _WalkedImage(NamedTuple):
    """The cells of an image, their links, light, and places in the lattice."""

    view: PyramidLevel
    cells: Cells
    mesh: CellMesh
    light: NDArray[np.float64]
    walk: Walk

    def seen_from(self, mirrored: bool) -> WalkedCells:
        return seen_from(self.cells, self.mesh, self.walk, mirrored)


class SeenPart(NamedTuple):
    """A part with its colors.

    Attributes:
        part: its number.
        cells: the cells of the image.
        fields: the colors around the part.
        mirrored: the part is seen from its back.
        naming: (3,) float64, log odds of the namings.
    """

    part: int
    cells: WalkedCells
    fields: InkFields
    mirrored: bool
    naming: NDArray[np.float64]


class PlacedPart(NamedTuple):
    """A part with its motions.

    Attributes:
        seen: the part.
        motions: the motions.
        white_axial: (W, 2) int32, of the white triangles.
        other_whites: number of these at black cells of a layout without a code, by the best motion.
        bits: of a coded layout.
    """

    seen: SeenPart
    motions: Motions
    white_axial: NDArray[np.int32]
    other_whites: int
    bits: CodeBits | None

    @property
    def lead(self) -> float:
        scores = self.motions.score
        lead = float(scores[0] - scores[1]) if len(scores) > 1 else np.inf
        return lead - OTHER_WHITE * self.other_whites

    @property
    def is_own(self) -> NDArray[np.bool_]:
        """(N,) bool, the part's cells."""
        return np.asarray(self.seen.cells.part == self.seen.part)

    @property
    def tied(self) -> NDArray[np.intp]:
        """(T,) the motions that are not certainly worse than the best."""
        return np.flatnonzero(self.motions.score > self.motions.score.max(initial=-np.inf) - LEAD)

    @property
    def is_certain(self) -> bool:
        if len(self.motions.score) == 0 or self.lead < LEAD:
            return False
        return (
            self.bits is None or self.is_proved_by_bits or (self.lead_without_bits >= LEAD and self.is_code)
        )

    @property
    def is_code(self) -> bool:
        """Whether the best motion, if it is right, shows the code of the layout, if the layout has one."""
        return self.bits is None or self.bits.proves(self.agreement._replace(motions=1), lead=0.0)

    def has_motion_of(self, other: PlacedPart) -> bool:
        """Whether the best motions of both agree."""
        own, others = self.motions, other.motions
        return bool(own.pad[0] == others.pad[0] and (own.motion[0] == others.motion[0]).all())

    @property
    def is_proved_by_bits(self) -> bool:
        return self.bits is not None and self.bits.proves(self.agreement, self.lead)

    @property
    def agreement(self) -> Agreement:
        """Of the best motion."""
        motions = self.motions
        return Agreement(float(motions.white[0]), int(motions.known_white[0]), motions.compared)

    @property
    def lead_without_bits(self) -> float:
        """Log odds of the best motion over the others by all witnesses but the bits."""
        motions = self.motions
        return float(motions.score[0] - motions.white[0]) - motions.rival_without_white


class Registration:
    """Registers the cells of images with the layouts of one family.

    Args:
        lattices: the layouts, which differ in their white cells alone.
        palette: their inks.
        mirrored: whether images show the back; None where both sides are read.
    """

    def __init__(self, lattices: Sequence[Lattice], palette: Palette, mirrored: bool | None) -> None:
        self._lattice = lattice = lattices[0]
        self._palette = palette
        self._mirrored = mirrored
        whites = [one.white_axial for one in lattices]
        white_pad = np.repeat(np.arange(len(whites), dtype=np.int32), [len(one) for one in whites])
        self._layout = RegisteredLayout(lattice.axial, np.concatenate(whites), white_pad, lattice.cell_lookup)
        self._is_family = len(lattices) > 1
        self._is_coded = len(whites[0]) > 1
        self.min_cells = max(MIN_LAYOUT_SHARE * len(lattice.ink), min(MIN_CELLS, len(lattice.ink)))

    def number(
        self, view: PyramidLevel, cells: Cells, mesh: CellMesh, light: NDArray[np.float64], walk: Walk
    ) -> Numbering | Refusal:
        """The numbers of the cells, or the reason why there are none.

        Args:
            view: the image at the scale of recognition.
            cells, mesh, light, walk: the cells of the image, their links, light, and places in the lattice.
        """
        sizes = walk.sizes
        large = [int(p) for p in np.argsort(-sizes, kind="stable")[:MAX_PARTS] if sizes[p] >= self.min_cells]
        if not large:
            return Refusal(Reason.NO_PATTERN)
        image = _WalkedImage(view, cells, mesh, light, walk)
        seen = [self._see(image, part) for part in large]
        bright = BrightPlaces.of([one.fields.whiteness for one in seen if isinstance(one, SeenPart)])
        found = [self.register(one, bright) if isinstance(one, SeenPart) else one for one in seen]
        placed = [one for one in found if isinstance(one, PlacedPart)]
        certain = [one for one in placed if one.is_certain]
        if placed and not certain:
            fewest = min(placed, key=lambda one: len(one.tied) or MAX_TIED)
            certain = self._decided_by_all(image, fewest, bright)
        for one in certain:
            numbering = self._number_with(one, placed)
            if numbering is not None:
                return numbering
        return (
            found[0]
            if isinstance(found[0], Refusal)
            else Refusal(_uncertain_reason(found[0]), found[0].seen.fields)
        )

    def _see(self, image: _WalkedImage, part: int) -> SeenPart | Refusal:
        """The colors of a part, or the reason why its side is refused."""
        mirrored = bool(self._mirrored)
        walked = image.seen_from(mirrored)
        fields = ink_fields(image.view, walked, image.light, part)
        if fields.fit < MIN_FIT:
            return Refusal(Reason.NO_PATTERN, fields)
        own, other = self._palette.naming(fields.shares), self._palette.naming(fields.shares, other_side=True)
        lead = float(other.max() - own.max())
        if self._mirrored is None and lead > 0.0:
            mirrored = not mirrored
            walked = image.seen_from(mirrored)
            fields = ink_fields(image.view, walked, image.light, part)
            own = self._palette.naming(fields.shares)
        is_other = abs(lead) < SIDE_LEAD if self._mirrored is None else lead > SIDE_LEAD
        if is_other:
            known = self._mirrored is not None
            reason = self._palette.other_side_reason(fields.shares) if known else Reason.OTHER_SIDE
            return Refusal(reason, fields)
        naming = NAMING_WEIGHT * (own - own.max())
        # where all classes look alike it is the tiling of another pattern, or the light shows no ink
        return (
            SeenPart(part, walked, fields, mirrored, naming)
            if naming.min() < -LEAD
            else Refusal(Reason.NO_PATTERN, fields)
        )

    def register(self, seen: SeenPart, bright: BrightPlaces) -> PlacedPart:
        """A part with its motions."""
        fields = seen.fields
        axial = np.ascontiguousarray(seen.cells.axial[seen.cells.part == seen.part])
        bits = CodeBits.of(fields, axial) if self._is_coded else None
        white = bright.white_odds(fields) if bits is None else bits.odds
        motions = native.register_part(axial, seen.naming, fields.down_axial, white, self._layout)
        white_axial = fields.down_axial[fields.is_triangle]
        return PlacedPart(seen, motions, white_axial, self._other_whites(white_axial, motions), bits)

    def _other_whites(self, white_axial: NDArray[np.int32], motions: Motions) -> int:
        """The number of white triangles (W, 2) that the best motion carries to black cells of the layout.

        None of a coded layout, where each is a wrong bit.
        """
        if len(motions.score) == 0 or self._is_coded:
            return 0
        turn, dq, dr = (int(v) for v in motions.motion[0])
        count = 0
        for q, r in white_axial.tolist():
            for _ in range(turn):
                q, r = -q - r, q - 1
            q, r = q + dq, r + dr
            if (q, r) != (0, 0):
                beside = cells_at(np.array([[q, r], [q - 1, r], [q - 1, r + 1]], np.int32), self._lattice)
                count += bool((beside >= 0).all())
        return count

    def _decided_by_all(
        self, image: _WalkedImage, placed: PlacedPart, bright: BrightPlaces
    ) -> list[PlacedPart]:
        """The part with a motion that is certain by the cells and bits of all parts; else nothing.

        Parts that can be joined to the part without the layout have one motion with the part, and no vote of their own.
        """
        seen = placed.seen
        cells = joined_to(seen.part, seen.cells, seen.fields.odds, self._lattice.layers)
        if np.count_nonzero(cells.part == seen.part) > np.count_nonzero(placed.is_own):
            fields = ink_fields(image.view, cells, image.light, seen.part)
            placed = self.register(seen._replace(cells=cells, fields=fields), bright)
        is_certain = placed.is_certain and (placed.bits is not None or placed.lead >= JOINT_LEAD)
        found = [placed] if is_certain else self._with_all_parts(placed, len(placed.tied))
        return [one._replace(seen=seen) for one in found]

    def _with_all_parts(self, placed: PlacedPart, count: int) -> list[PlacedPart]:
        """The part with a certain motion, if the other parts decide between its best motions; else nothing.

        Under each motion the other parts are registered; a cell without a place counts as one outside the layout.

        Args:
            placed: the part.
            count: number of its best motions that are compared.
        """
        if not 1 < count <= MAX_TIED:
            return []
        motions = placed.motions
        # the pads of a family have the same cells at the same places
        _, first, same = np.unique(motions.motion[:count], axis=0, return_index=True, return_inverse=True)
        counts = [
            np.count_nonzero(self._placed_cells(placed, int(k), with_single_cells=False) >= 0) for k in first
        ]
        score = motions.score[:count] + native.OUTSIDE_WEIGHT * np.array(counts)[same.reshape(-1)]
        order = np.argsort(-score, kind="stable")
        chosen = motions.chosen(order, score[order])
        decided = placed._replace(motions=chosen, other_whites=self._other_whites(placed.white_axial, chosen))
        is_certain = decided.lead >= JOINT_LEAD and (not self._is_family or decided.is_proved_by_bits)
        return [decided] if is_certain and decided.is_code else []

    def _placed_cells(
        self, placed: PlacedPart, number: int, with_single_cells: bool = True
    ) -> NDArray[np.int32]:
        """(N,) int32, the layout's cell of each cell of the image by a motion of the part, or -1."""
        seen, motion = placed.seen, placed.motions.motion[number]
        cell = native.moved_cells(seen.cells, seen.part, motion, self._layout.cell_lookup)
        turn, dq, dr = motion.tolist()
        # a turn shifts the classes (q - r) mod 3 by -1
        odds = np.roll(seen.fields.odds, dq - dr - turn, axis=1)
        return native.attach_parts(
            seen.cells,
            cell,
            odds,
            self._lattice.layout_cells,
            self._layout.axial,
            self._layout.cell_lookup,
            with_single_cells,
        )

    def _number_with(self, placed: PlacedPart, parts: list[PlacedPart]) -> Numbering | Refusal | None:
        """The numbers of all cells by the part whose motion is certain; none if the other parts contradict the
        motion."""
        cell = self._placed_cells(placed, 0)
        is_numbered = cell >= 0
        own = [one.is_own for one in parts]
        count = sum(np.count_nonzero(one) for one in own)
        numbered = [np.count_nonzero(is_numbered & one) for one in own]
        if sum(numbered) < MIN_NUMBERED_SHARE * count:
            first = next(one for one in parts if one.seen.part == placed.seen.part)
            again = self._with_all_parts(first, len(first.motions.score))
            if not again or not again[0].has_motion_of(placed):
                return None
        others = [one for one, found in zip(parts, numbered, strict=True) if found == 0]
        if any(one.is_certain and one.motions.white[0] > 0.0 for one in others):
            return Refusal(Reason.SEVERAL_PADS, placed.seen.fields)
        white = float(placed.motions.white[0])
        misfit = 0.0 if placed.bits is None else placed.bits.misfit(white)
        return Numbering(
            cell,
            int(placed.motions.pad[0]),
            placed.seen.mirrored,
            _origin(placed),
            placed.lead,
            placed.seen.fields,
            misfit,
        )


def _origin(placed: PlacedPart) -> Origin:
    if placed.bits is not None:
        return Origin.CODE if placed.is_proved_by_bits else Origin.OUTLINE
    return Origin.WHITE if placed.motions.white[0] > 0.0 else Origin.OUTLINE


def _uncertain_reason(placed: PlacedPart) -> Reason:
    """Why a part has no certain motion."""
    if placed.bits is not None:
        is_other = len(placed.motions.score) > 0 and placed.bits.is_other(placed.agreement)
        return Reason.OTHER_CODE if is_other else Reason.AMBIGUOUS
    white = placed.motions.white
    close = placed.tied
    whites = np.count_nonzero(white[close] > 0.0) + placed.other_whites
    if whites > 1:
        return Reason.SEVERAL_PADS
    may_be_white = (white[close] >= 0.0) & (placed.motions.known_white[close] > 0)
    return Reason.AMBIGUOUS if np.count_nonzero(may_be_white) > 1 else Reason.REFERENCE_LOST
