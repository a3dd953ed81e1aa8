"""Inks by the lattice: the colors of the three classes (q - r) mod 3 are smooth fields over a part.

Open is only which field is which ink: the naming. It is decided once an image by the fields' shares of the light in
each channel, compared with the palette's. A hue is not asked for: colored light may move all hues, and order the
fields all the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.image.pyramid import PyramidLevel
from extractor.image.response import light_of_values
from extractor.numbering.lattice_walk import WalkedCells
from extractor.result import Reason

# of the misfits of a mirrored view and of swapped channels, the smaller one to the larger one; chosen
MAX_MISFIT_RATIO = 0.7
LEAST_PALETTE_SHARE = 0.02  # of the light of an ink in a channel; chosen


class InkFieldLimits(NamedTuple):
    """Limits of the fields.

    Attributes:
        place_softening: in squared edges, added to the squared distance of a cell from a down-cell whose place it
            predicts. Chosen.
        place_reach2: squared edges; cells farther away predict no place. Derived: two steps.
        residual_scale: in median residuals, at which a cell has half of its weight in the fit of a field. Chosen.
        least_share: of the strongest field, the least of another one, to take its logarithm. Chosen.
        least_scatter: of a field's light, the least scatter of cells. Chosen.
        bright: whiteness of a down-cell that is not black. Chosen.
        towards_corner: share of the way from its center to its corners, up to which a white cell is white. Chosen:
            beyond it is blurred.
        across_side: share of the way from its center to those of the cells beside it, from which on these are not
            white.
            Chosen: the side lies at a half.
        corner_likeness: of the light of the center, the largest difference there. Chosen.
        likeness: of a field's light, the largest difference of a cell that is like it. Chosen.
        robust_rounds: fits of a field, the first ones of lower degrees. Chosen.
        quadratic_cells, linear_cells: of a field, from which on its degree is 2 or 1. Derived: three cells for each
            coefficient.
    """

    place_softening: float = 0.1
    place_reach2: float = 2.5
    residual_scale: float = 2.0
    least_share: float = 0.02
    least_scatter: float = 0.15
    bright: float = 0.6
    towards_corner: float = 0.55
    across_side: float = 0.78
    corner_likeness: float = 0.5
    likeness: float = 0.5
    robust_rounds: int = 4
    quadratic_cells: int = 18
    linear_cells: int = 9


LIMITS = InkFieldLimits()


@dataclass(frozen=True, eq=False)
class InkFields:
    """The colors around one part.

    Attributes:
        shares: (3, 3) float64, the mean log of each class's share of the light in each channel (B, G, R).
        odds: (N, 3) float64, the log likelihoods of each cell of the image for the three classes, relative to the
            likeliest one.
        down_axial: (D, 2) int32, the part's down-cells: the black ones and the white one.
        whiteness: (D,) float64, their light over the black around, relative to the strongest inks there; NaN outside
            the image.
        is_triangle: (D,) bool, the bright ones of which the light fills the triangle, and no cell beside it; a drop,
            glare or a scratch hardly ever ends at the sides of a cell.
        fit: the share of the part's cells whose color is like that of their class's field.
    """

    shares: NDArray[np.float64]
    odds: NDArray[np.float64]
    down_axial: NDArray[np.int32]
    whiteness: NDArray[np.float64]
    is_triangle: NDArray[np.bool_]
    fit: float


class Palette:
    """The light of a layout's inks.

    Args:
        colors: name -> "#rrggbb".
    """

    def __init__(self, colors: dict[str, str]) -> None:
        light = np.asarray(light_of_values("srgb"), np.float64)
        inks = np.array(
            [[light[int(colors[ink][i : i + 2], 16)] for i in (5, 3, 1)] for ink in ("red", "green", "blue")]
        )
        inks = np.maximum(inks, LEAST_PALETTE_SHARE * inks.max())
        self._shares = inks / inks.sum(axis=0)  # (3, 3) of each ink in each channel

    def naming(self, shares: NDArray[np.float64], other_side: bool = False) -> NDArray[np.float64]:
        """(3,) float64, how well class k + t is ink k, for t = 0, 1, 2: mean log likelihoods, summed over channels.

        Args:
            shares: of ``InkFields``.
            other_side: of the pattern seen from its other side, in whose frame class k is class -k.
        """
        inks = np.arange(3)
        return np.array(
            [
                float((self._shares * shares[((-1 if other_side else 1) * (inks - t)) % 3]).sum())
                for t in range(3)
            ]
        )

    def other_side_reason(self, shares: NDArray[np.float64]) -> Reason:
        """Why the inks are in the order of another side than stated: a mirrored view has the palette's shares as they
        are, an image with swapped channels has them swapped."""
        as_is, swapped = (
            self._misfit(shares, other_side=True),
            self._misfit(shares[:, ::-1], other_side=False),
        )
        if min(as_is, swapped) > MAX_MISFIT_RATIO * max(as_is, swapped):
            return Reason.OTHER_SIDE
        return Reason.MIRRORED if as_is < swapped else Reason.SWAPPED_CHANNELS

    def _misfit(self, shares: NDArray[np.float64], other_side: bool) -> float:
        """The mean difference of the log shares from the palette's by the best naming."""
        t = int(self.naming(shares, other_side).argmax())
        ordered = shares[((-1 if other_side else 1) * (np.arange(3) - t)) % 3]
        return float(np.abs(ordered - np.log(self._shares)).mean())


def ink_fields(view: PyramidLevel, cells: WalkedCells, light: NDArray[np.float64], part: int) -> InkFields:
    """The colors around a part of the walked cells, in the image at the scale of recognition; light (N, 3) of the
    cells."""
    return InkFields(*native.ink_fields(view, cells, light, part, LIMITS))
