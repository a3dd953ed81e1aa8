"""What undoes the layer's answer, nearly: the preconditioner of ``quadratic``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.green import GreenKernels
from cmpdesign.contact.elastic_layer.kernels import layer_compliances

Single = NDArray[np.float32]


@dataclass(frozen=True)
class InversePreconditioner:
    """The layer's inverse without the coupling to z, as if the box repeated: a preconditioner, at a third of the cost.

    Attributes:
        xx, yy, xy, zz: MPa/mm at the waves of a box of ``shape``.
        stiffest: compliance in mm/MPa of the grid's shortest wave.
    """

    shape: tuple[int, int]
    xx: Single
    yy: Single
    xy: Single
    zz: Single
    stiffest: float

    @classmethod
    def of(cls, green: GreenKernels, box: tuple[int, int]) -> Self:
        """For a box of cells."""
        from scipy.fft import next_fast_len

        rows, columns = (int(next_fast_len(n, real=True)) for n in box)
        turn = 2 * np.pi / green.step_mm
        kx, ky = np.meshgrid(turn * np.fft.rfftfreq(columns), turn * np.fft.fftfreq(rows))
        k = np.hypot(kx, ky)
        even = k == 0
        # A thick layer gives way to even load without end; but the load ends at the box.
        k[even] = 0.5 * turn / max(rows, columns)
        c = layer_compliances(k, green.elastomer)
        x, y = kx / k, ky / k
        # An incompressible layer hardly answers to even pressure: the longest waves count as no stiffer than this.
        softest = k.flat[np.argmax(c.zz)]
        zz = 1 / np.where(k < softest, np.maximum(c.zz, 0.4 * c.zz.max()), c.zz)
        along, across = 1 / c.ll, 1 / c.sh
        parts = (x**2 * along + y**2 * across, y**2 * along + x**2 * across, x * y * (along - across), zz)
        parts[0][even] = parts[1][even] = along[even]
        xx, yy, xy, inverse = (one.astype(np.float32) for one in parts)
        shortest = layer_compliances(np.array(np.pi / green.step_mm), green.elastomer)
        return cls((rows, columns), xx, yy, xy, inverse, float(shortest.ll))

    def __call__(self, values: Single) -> Single:
        """MPa from mm, (3, rows, columns) or (1, rows, columns)."""
        from scipy.fft import irfft2, rfft2

        rows, columns = values.shape[1:]
        given = rfft2(values, s=self.shape, workers=1)
        found = given * self.zz
        if len(values) == 3:
            found[0] = self.xx * given[0] + self.xy * given[1]
            found[1] = self.xy * given[0] + self.yy * given[1]
        return np.asarray(irfft2(found, s=self.shape, workers=1, overwrite_x=True)[:, :rows, :columns])
