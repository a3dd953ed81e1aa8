"""Surface displacement from surface traction on a box of cells, by zero-padded FFT."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.green import Green

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]


class Operator:
    """The linear map C from tractions to displacements on a (rows, columns) box of the grid.

    It is symmetric and positive definite: what a load at A does at B, the same load at B does at A.
    The padding keeps the FFT's repetition out: twice the box, or the box and the kernels' reach if that is less.
    """

    def __init__(self, green: Green, shape: tuple[int, int]) -> None:
        from scipy.fft import next_fast_len, rfft2

        self.shape = shape
        self.padded = tuple(int(next_fast_len(n + min(n, green.reach), real=True)) for n in shape)

        def spectrum(kernel: Array, odd_y: bool, odd_x: bool) -> Array:
            whole = rfft2(_wrapped(kernel, self.padded, odd_y, odd_x), workers=1)
            return np.ascontiguousarray(whole.imag if odd_y != odd_x else whole.real)

        self._zz = spectrum(green.zz, False, False)
        self._xx = spectrum(green.xx, False, False)
        self._yy = spectrum(green.yy, False, False)
        self._xy = spectrum(green.xy, True, True)
        self._xz = spectrum(green.xz, False, True)
        self._yz = spectrum(green.yz, True, False)
        self._found = np.empty((3, *self._zz.shape), dtype=np.complex128)
        self._part = np.empty(self._zz.shape, dtype=np.complex128)
        self.largest = self._largest()
        self.largest_normal = float(np.abs(self._zz).max())

    def _largest(self) -> float:
        """A bound on all eigenvalues in mm/MPa: of the plane's block, then of that with z."""
        plane = (self._xx + self._yy) / 2 + np.hypot((self._xx - self._yy) / 2, self._xy)
        both = (plane + self._zz) / 2 + np.hypot((plane - self._zz) / 2, np.hypot(self._xz, self._yz))
        return float(both.max())

    def __call__(self, traction_mpa: Array) -> Array:
        """Displacement (3, rows, columns) in mm of the traction (3, rows, columns) in MPa."""
        # The spectra of xz and yz are imaginary; with z turned by i, the equations are real and symmetric.
        x, y, z = self._forward(traction_mpa)
        z *= 1j
        found, part = self._found, self._part
        for axis, (from_x, from_y, from_z) in enumerate(
            ((self._xx, self._xy, self._xz), (self._xy, self._yy, self._yz), (self._xz, self._yz, self._zz))
        ):
            np.multiply(from_x, x, out=found[axis])
            found[axis] += np.multiply(from_y, y, out=part)
            found[axis] += np.multiply(from_z, z, out=part)
        found[2] *= -1j
        return self._back(found)

    def normal(self, traction_z_mpa: Array) -> Array:
        """Displacement z (rows, columns) in mm of the traction z (rows, columns) in MPa alone."""
        found: Array = self._back(self._forward(traction_z_mpa[None]) * self._zz)[0]
        return found

    def _forward(self, values: Array) -> Spectrum:
        """The padded spectrum; the padding's rows are not transformed along x, as they are empty."""
        from scipy.fft import fft, rfft

        along = rfft(values, n=self.padded[1], axis=2, workers=1)
        return np.asarray(fft(along, n=self.padded[0], axis=1, workers=1, overwrite_x=True))

    def _back(self, spectrum: Spectrum) -> Array:
        """The box's part of the values."""
        from scipy.fft import ifft, irfft

        rows, columns = self.shape
        along = ifft(spectrum, axis=1, workers=1, overwrite_x=True)[:, :rows]
        return np.asarray(irfft(along, n=self.padded[1], axis=2, workers=1)[:, :, :columns])


def _wrapped(kernel: Array, padded: tuple[int, ...], odd_y: bool, odd_x: bool) -> Array:
    """The quadrant of offsets >= 0 as the whole plane in the FFT's order."""
    rows, sign_y = _folded(padded[0], len(kernel), odd_y)
    columns, sign_x = _folded(padded[1], len(kernel), odd_x)
    return np.asarray(kernel[np.ix_(rows, columns)] * np.outer(sign_y, sign_x))


def _folded(padded: int, known: int, odd: bool) -> tuple[NDArray[np.int64], Array]:
    """For each index of an axis, the offset's size and the sign there (0 where there is nothing to know)."""
    offset = np.fft.fftfreq(padded, 1 / padded).round().astype(np.int64)
    size = np.abs(offset)
    sign = np.sign(offset).astype(np.float64) if odd else np.ones(padded)
    if odd and padded % 2 == 0:
        sign[padded // 2] = 0.0
    return np.minimum(size, known - 1), np.where(size < known, sign, 0.0)
