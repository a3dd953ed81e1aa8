"""Inks by the lattice: the colors of the three classes (q - r) mod 3 are smooth fields over a part.

Open is only which field is which ink: the naming. It is decided once an image by the fields' shares of the light in
each channel, compared with the palette's. A hue is not asked for: colored light may move all hues, and order the
fields all the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extractor._native import numbering as native
from extractor.image.pyramid import PyramidLevel
from extractor.image.response import light_of_values
from extractor.numbering.lattice_walk import WalkedCells
from extractor.result import Reason

# of the misfits of a mirrored view and of swapped channels, the smaller one to the larger one; chosen
MAX_MISFIT_RATIO = 0.7
# (2, 3, 3) the class that is each ink, for a view of the stated or of the other side, and for each naming
CLASS_OF_INK = np.array([[(sign * (np.arange(3) - t)) % 3 for t in range(3)] for sign in (1, -1)])
MIN_PALETTE_SHARE = 0.02  # of the light of an ink in a channel; chosen


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
        inks = np.maximum(inks, MIN_PALETTE_SHARE * inks.max())
        self._shares = inks / inks.sum(axis=0)  # (3, 3) of each ink in each channel

    def naming(self, shares: NDArray[np.float64], other_side: bool = False) -> NDArray[np.float64]:
        """(3,) float64, how well class k + t is ink k, for t = 0, 1, 2: mean log likelihoods, summed over channels.

        Args:
            shares: of ``InkFields``.
            other_side: of the pattern seen from its other side, in whose frame class k is class -k.
        """
        return np.asarray((self._shares * shares[CLASS_OF_INK[int(other_side)]]).sum(axis=(1, 2)))

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
        ordered = shares[CLASS_OF_INK[int(other_side), t]]
        return float(np.abs(ordered - np.log(self._shares)).mean())


def ink_fields(view: PyramidLevel, cells: WalkedCells, light: NDArray[np.float64], part: int) -> InkFields:
    """The colors around a part of the walked cells, in the image at the scale of recognition; light (N, 3) of the
    cells."""
    return native.ink_fields(view, cells, light, part)
