"""The approximate inverse of the elastic layer's response: the preconditioner of ``quadratic_program``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.green import GreenKernels
from cmpdesign.contact.elastic_layer.kernels import layer_compliances
from cmpdesign.libraries import extra

Single = NDArray[np.float32]


@dataclass(frozen=True)
class InversePreconditioner:
    """The elastic layer's inverse without the coupling to z, on a periodic box, at a third of the operator's cost.

    Attributes:
        shape: rows and columns of the transform.
        xx, yy, xy, zz: float32 MPa/mm at the waves of a box of ``shape``.
        shortest_wave_compliance: mm/MPa at the grid's shortest wave.
    """

    shape: tuple[int, int]
    xx: Single
    yy: Single
    xy: Single
    zz: Single
    shortest_wave_compliance: float

    @classmethod
    def of(cls, green: GreenKernels, box: tuple[int, int]) -> Self:
        """The preconditioner for a box of (rows, columns) cells."""
        with extra("evaluate"):
            from scipy.fft import next_fast_len

        rows, columns = (int(next_fast_len(n, real=True)) for n in box)
        sampling_rate = 2 * np.pi / green.step_mm
        kx, ky = np.meshgrid(sampling_rate * np.fft.rfftfreq(columns), sampling_rate * np.fft.fftfreq(rows))
        k = np.hypot(kx, ky)
        uniform = k == 0
        # Under uniform load the compliance of a thick elastic layer has no limit, but the load ends at the box.
        k[uniform] = 0.5 * sampling_rate / max(rows, columns)
        c = layer_compliances(k, green.elastomer)
        x, y = kx / k, ky / k
        # An incompressible layer hardly yields to uniform pressure: the longest waves are limited in stiffness.
        softest_wave = k.flat[np.argmax(c.zz)]
        zz = 1 / np.where(k < softest_wave, np.maximum(c.zz, 0.4 * c.zz.max()), c.zz)
        longitudinal, shear = 1 / c.ll, 1 / c.sh
        parts = (
            x**2 * longitudinal + y**2 * shear,
            y**2 * longitudinal + x**2 * shear,
            x * y * (longitudinal - shear),
            zz,
        )
        parts[0][uniform] = parts[1][uniform] = longitudinal[uniform]
        xx, yy, xy, inverse = (part.astype(np.float32) for part in parts)
        shortest_wave = layer_compliances(np.array(np.pi / green.step_mm), green.elastomer)
        return cls((rows, columns), xx, yy, xy, inverse, float(shortest_wave.ll))

    def __call__(self, values: Single) -> Single:
        """Tractions in MPa from displacements in mm, (3, rows, columns) or (1, rows, columns) float32."""
        with extra("evaluate"):
            from scipy.fft import irfft2, rfft2

        rows, columns = values.shape[1:]
        spectrum = rfft2(values, s=self.shape, workers=1)
        inverse = spectrum * self.zz
        if len(values) == 3:
            inverse[0] = self.xx * spectrum[0] + self.xy * spectrum[1]
            inverse[1] = self.xy * spectrum[0] + self.yy * spectrum[1]
        return np.asarray(irfft2(inverse, s=self.shape, workers=1, overwrite_x=True)[:, :rows, :columns])
