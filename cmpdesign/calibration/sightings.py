"""What a calibration is given: the points of a sheet, and where each picture shows them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ids = NDArray[np.intp]


class Sighting(NamedTuple):
    """The points of the sheet in one picture.

    Attributes:
        name: the picture's, for messages.
        ids: (N,) int, the points.
        xy_px: (N, 2) float64.
        cov_px2: (N, 2, 2) float64; None: unknown, the same for all points.
    """

    name: str
    ids: Ids
    xy_px: Array
    cov_px2: Array | None = None

    @property
    def whitening(self) -> Array:
        """(N, 2, 2) matrices that make the points' deviations 1; of unknown deviations the unit matrix, per px."""
        if self.cov_px2 is None:
            return np.tile(np.eye(2), (len(self.ids), 1, 1))
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.cov_px2)))


@dataclass(frozen=True, eq=False)
class Sheet:
    """The points of a sheet, nominally in the plane z = 0, and the smooth shapes that it may have.

    Attributes:
        xy_mm: (M, 2) float64.
    """

    xy_mm: Array

    @property
    def size_mm(self) -> float:
        """Half the larger side of the points' bounding box."""
        return float(np.ptp(self.xy_mm, axis=0).max() / 2)

    @property
    def flat_mm(self) -> Array:
        """(M, 3) the points of the flat sheet."""
        return np.column_stack([self.xy_mm, np.zeros(len(self.xy_mm))])

    @cached_property
    def bending(self) -> Array:
        """(M, 3, S) smooth displacements, of 1 at the rim: polynomials up to the fourth degree, without a motion.

        Along x and y, the first degree is the ratio of the sides and the shear of a printer, and the higher ones are
        the shortening of a bent sheet.
        """
        middle = (self.xy_mm.max(axis=0) + self.xy_mm.min(axis=0)) / 2
        x, y = ((self.xy_mm - middle) / self.size_mm).T
        columns = [np.stack([x, -y, 0 * x], axis=1), np.stack([y, x, 0 * x], axis=1)]
        for degree in (2, 3, 4):
            for power in range(degree + 1):
                values = x ** (degree - power) * y**power
                columns += [np.outer(values, axis) for axis in np.eye(3)]
        return np.stack(columns, axis=2)

    @property
    def bending_spreads_mm(self) -> Array:
        """(S,) standard deviations of the displacements of usual sheets: a twentieth of the size, 1 % in the plane."""
        moves_out = np.abs(self.bending[:, 2]).max(axis=0) > 0
        return self.size_mm * np.where(moves_out, 0.05, 0.01)
