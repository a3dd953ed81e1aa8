"""Surface displacement from surface traction on a box of cells, by zero-padded FFT."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.green import Green

Array = NDArray[np.float64]


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
        # Gershgorin's bounds on the eigenvalues, in mm/MPa: of all three directions, and of z alone.
        xx, yy, zz, xy, xz, yz = map(abs, (self._xx, self._yy, self._zz, self._xy, self._xz, self._yz))
        self.largest = float(max((xx + xy + xz).max(), (yy + xy + yz).max(), (zz + xz + yz).max()))
        self.largest_normal = float(zz.max())

    def __call__(self, traction_mpa: Array) -> Array:
        """Displacement (3, rows, columns) in mm of the traction (3, rows, columns) in MPa."""
        from scipy.fft import irfft2, rfft2

        x, y, z = rfft2(traction_mpa, s=self.padded, workers=1)
        found = np.empty((3, *x.shape), dtype=np.complex128)
        found[0] = self._xx * x + self._xy * y + 1j * (self._xz * z)
        found[1] = self._xy * x + self._yy * y + 1j * (self._yz * z)
        found[2] = self._zz * z - 1j * (self._xz * x + self._yz * y)
        rows, columns = self.shape
        return np.asarray(irfft2(found, s=self.padded, workers=1)[:, :rows, :columns])

    def normal(self, traction_z_mpa: Array) -> Array:
        """Displacement z (rows, columns) in mm of the traction z (rows, columns) in MPa alone."""
        from scipy.fft import irfft2, rfft2

        spectrum = self._zz * rfft2(traction_z_mpa, s=self.padded, workers=1)
        rows, columns = self.shape
        return np.asarray(irfft2(spectrum, s=self.padded, workers=1)[:rows, :columns])


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
