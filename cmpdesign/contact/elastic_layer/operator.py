"""Surface displacement from surface traction on a box of cells, by zero-padded FFT."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.green import GreenKernels
from cmpdesign.contact.elastic_layer.inverse import InversePreconditioner

Array = NDArray[np.float64]
Single = NDArray[np.float32]
# In double or single precision.
Field = NDArray[Any]
Spectrum = NDArray[Any]


class ComplianceOperator:
    """The linear map C from tractions to displacements on a (rows, columns) box of the grid.

    It is symmetric and positive definite: what a load at A does at B, the same load at B does at A.
    The padding keeps the FFT's repetition out: twice the box, or the box and the kernels' reach if that is less.
    """

    def __init__(self, green: GreenKernels, shape: tuple[int, int]) -> None:
        from scipy.fft import next_fast_len, rfft2

        self.shape = shape
        self.padded = tuple(int(next_fast_len(n + min(n, green.reach), real=True)) for n in shape)

        def spectrum(kernel: Array, odd_y: bool, odd_x: bool) -> Field:
            whole = rfft2(_wrap_kernel(kernel, self.padded, odd_y, odd_x), workers=1)
            return np.ascontiguousarray(whole.imag if odd_y != odd_x else whole.real)

        zz = spectrum(green.zz, False, False)
        xx, yy = spectrum(green.xx, False, False), spectrum(green.yy, False, False)
        xy = spectrum(green.xy, True, True)
        xz, yz = spectrum(green.xz, False, True), spectrum(green.yz, True, False)
        self._spectra: dict[Any, list[Field]] = {
            np.dtype(kind): [one.astype(kind) for one in (xx, yy, zz, xy, xz, yz)]
            for kind in (np.float64, np.float32)
        }
        self._inverse = InversePreconditioner.of(green, shape)
        self._largest = {1: float(np.abs(zz).max()), 3: _eigenvalue_bound(xx, yy, zz, xy, xz, yz)}
        self.stiffest = self._inverse.stiffest

    def eigenvalue_bound(self, components: int) -> float:
        """At least the largest eigenvalue in mm/MPa, for z alone (1) or all three components."""
        return self._largest[components]

    def precondition(self, displacement_mm: Single) -> Single:
        """About the traction that makes a displacement, both as in a call; symmetric and positive definite."""
        return self._inverse(displacement_mm)

    def __call__(self, traction_mpa: Field) -> Field:
        """Displacement in mm of the traction in MPa, both (3, rows, columns), or (1, rows, columns) for z alone.

        In single precision if the traction is.
        """
        from cmpdesign.contact.elastic_layer.spectra import update_load_spectra

        spectra = self._spectra[traction_mpa.dtype]
        waves = self._forward_transform(traction_mpa)
        if len(waves) == 1:
            waves *= spectra[2]
        else:
            update_load_spectra(waves.view(spectra[0].dtype).reshape(*waves.shape, 2), *spectra)
        return self._inverse_transform(waves)

    def _forward_transform(self, values: Field) -> Spectrum:
        """The padded spectrum; the padding's rows are not transformed along x, as they are empty."""
        from scipy.fft import fft, rfft

        along = rfft(values, n=self.padded[1], axis=2, workers=1)
        return np.asarray(fft(along, n=self.padded[0], axis=1, workers=1, overwrite_x=True))

    def _inverse_transform(self, spectrum: Spectrum) -> Field:
        """The box's part of the values."""
        from scipy.fft import ifft, irfft

        rows, columns = self.shape
        along = ifft(spectrum, axis=1, workers=1, overwrite_x=True)[:, :rows]
        return np.asarray(irfft(along, n=self.padded[1], axis=2, workers=1)[:, :, :columns])


def _eigenvalue_bound(xx: Array, yy: Array, zz: Array, xy: Array, xz: Array, yz: Array) -> float:
    """A bound on all eigenvalues in mm/MPa: of the plane's block, then of that with z."""
    plane = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    both = (plane + zz) / 2 + np.hypot((plane - zz) / 2, np.hypot(xz, yz))
    return float(both.max())


def _wrap_kernel(kernel: Array, padded: tuple[int, ...], odd_y: bool, odd_x: bool) -> Array:
    """The quadrant of offsets >= 0 as the whole plane in the FFT's order."""
    rows, sign_y = _wrap_indices(padded[0], len(kernel), odd_y)
    columns, sign_x = _wrap_indices(padded[1], len(kernel), odd_x)
    return np.asarray(kernel[np.ix_(rows, columns)] * np.outer(sign_y, sign_x))


def _wrap_indices(padded: int, known: int, odd: bool) -> tuple[NDArray[np.int64], Array]:
    """For each index of an axis, the offset's size and the sign there (0 where there is nothing to know)."""
    offset = np.fft.fftfreq(padded, 1 / padded).round().astype(np.int64)
    size = np.abs(offset)
    sign = np.sign(offset).astype(np.float64) if odd else np.ones(padded)
    if odd and padded % 2 == 0:
        sign[padded // 2] = 0.0
    return np.minimum(size, known - 1), np.where(size < known, sign, 0.0)
