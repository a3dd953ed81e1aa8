"""Surface displacement from surface traction on a box of cells, by zero-padded FFT."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign._native import elastic_layer
from cmpdesign.contact.elastic_layer.green import GreenKernels
from cmpdesign.contact.elastic_layer.inverse import InversePreconditioner
from cmpdesign.libraries import extra

Array = NDArray[np.float64]
Single = NDArray[np.float32]
# Arrays of double or single precision.
Field = NDArray[Any]
Spectrum = NDArray[Any]


class KernelSpectra(NamedTuple):
    """Spectra of the kernels, (rows, columns / 2 + 1) each, real. Those of xz and yz are the imaginary parts."""

    xx: Field
    yy: Field
    zz: Field
    xy: Field
    xz: Field
    yz: Field


class ComplianceOperator:
    """The linear map C from tractions to displacements on a (rows, columns) box of the grid.

    C is symmetric and positive definite: a load at A displaces B as the same load at B displaces A.
    Padding excludes the FFT's periodic images: to twice the box, or to the box plus the kernels' reach if this is less.

    Attributes:
        shape: rows and columns of the box.
        padded: rows and columns of the transform.
        shortest_wave_compliance: mm/MPa at the grid's shortest wave.
    """

    def __init__(self, green: GreenKernels, shape: tuple[int, int]) -> None:
        with extra("evaluate"):
            from scipy.fft import next_fast_len, rfft2

        self.shape = shape
        self.padded = tuple(int(next_fast_len(n + min(n, green.reach), real=True)) for n in shape)

        def spectrum(kernel: Array, odd_y: bool, odd_x: bool) -> Field:
            whole = rfft2(_wrap_kernel(kernel, self.padded, odd_y, odd_x), workers=1)
            return np.ascontiguousarray(whole.imag if odd_y != odd_x else whole.real)

        spectra = KernelSpectra(
            xx=spectrum(green.xx, False, False),
            yy=spectrum(green.yy, False, False),
            zz=spectrum(green.zz, False, False),
            xy=spectrum(green.xy, True, True),
            xz=spectrum(green.xz, False, True),
            yz=spectrum(green.yz, True, False),
        )
        self._spectra = {
            np.dtype(kind): KernelSpectra(*(part.astype(kind) for part in spectra))
            for kind in (np.float64, np.float32)
        }
        self._inverse = InversePreconditioner.of(green, shape)
        self._eigenvalue_bounds = {1: float(np.abs(spectra.zz).max()), 3: _eigenvalue_bound(spectra)}
        self.shortest_wave_compliance = self._inverse.shortest_wave_compliance

    def eigenvalue_bound(self, components: int) -> float:
        """An upper bound of the largest eigenvalue in mm/MPa, for z alone (1 component) or all 3 components."""
        return self._eigenvalue_bounds[components]

    def precondition(self, displacement_mm: Single) -> Single:
        """Approximate traction of a displacement, shaped as in ``__call__``; symmetric and positive definite."""
        return self._inverse(displacement_mm)

    def __call__(self, traction_mpa: Field) -> Field:
        """Displacement in mm of the traction in MPa, both (3, rows, columns), or (1, rows, columns) for z alone.

        The result has the traction's precision, float64 or float32.
        """
        spectra = self._spectra[traction_mpa.dtype]
        waves = self._forward_transform(traction_mpa)
        if len(waves) == 1:
            waves *= spectra.zz
        else:
            update = getattr(elastic_layer, f"update_load_spectra_{spectra.xx.dtype.name}")
            update(waves.view(spectra.xx.dtype).reshape(*waves.shape, 2), *spectra)
        return self._inverse_transform(waves)

    def _forward_transform(self, values: Field) -> Spectrum:
        """The padded spectrum. The padding's rows are empty and are not transformed along x."""
        with extra("evaluate"):
            from scipy.fft import fft, rfft

        along = rfft(values, n=self.padded[1], axis=2, workers=1)
        return np.asarray(fft(along, n=self.padded[0], axis=1, workers=1, overwrite_x=True))

    def _inverse_transform(self, spectrum: Spectrum) -> Field:
        """The values in the box."""
        with extra("evaluate"):
            from scipy.fft import ifft, irfft

        rows, columns = self.shape
        along = ifft(spectrum, axis=1, workers=1, overwrite_x=True)[:, :rows]
        return np.asarray(irfft(along, n=self.padded[1], axis=2, workers=1)[:, :, :columns])


def interior_displacement_mm(green: GreenKernels, traction_mpa: Array) -> Array:
    """Displacement (3, rows, columns) in mm at the kernels' depth, of a traction (3, rows, columns) in MPa."""
    with extra("evaluate"):
        from scipy.fft import irfft2, next_fast_len, rfft2

    shape = traction_mpa.shape[1:]
    padded = tuple(int(next_fast_len(n + min(n, green.reach), real=True)) for n in shape)

    def spectrum(kernel: Array, odd_y: bool = False, odd_x: bool = False) -> Spectrum:
        return np.asarray(rfft2(_wrap_kernel(kernel, padded, odd_y, odd_x), workers=1))

    x, y, z = rfft2(traction_mpa, s=padded, workers=1)
    across = spectrum(green.xy, True, True)
    waves = (
        spectrum(green.xx) * x + across * y + spectrum(green.xz, odd_x=True) * z,
        across * x + spectrum(green.yy) * y + spectrum(green.yz, odd_y=True) * z,
        spectrum(green.zz) * z - spectrum(green.zx, odd_x=True) * x - spectrum(green.zy, odd_y=True) * y,
    )
    return np.stack([irfft2(wave, s=padded, workers=1)[: shape[0], : shape[1]] for wave in waves])


def _eigenvalue_bound(spectra: KernelSpectra) -> float:
    """An upper bound of all eigenvalues in mm/MPa: of the in-plane block, then of this block with z."""
    xx, yy, zz, xy, xz, yz = spectra
    plane = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    space = (plane + zz) / 2 + np.hypot((plane - zz) / 2, np.hypot(xz, yz))
    return float(space.max())


def _wrap_kernel(kernel: Array, padded: tuple[int, ...], odd_y: bool, odd_x: bool) -> Array:
    """The plane of all offsets in the FFT's order, from the quadrant of offsets >= 0."""
    rows, sign_y = _wrap_indices(padded[0], len(kernel), odd_y)
    columns, sign_x = _wrap_indices(padded[1], len(kernel), odd_x)
    return np.asarray(kernel[np.ix_(rows, columns)] * np.outer(sign_y, sign_x))


def _wrap_indices(padded: int, known: int, odd: bool) -> tuple[NDArray[np.int64], Array]:
    """(padded,) each: the offset's size at each index of an axis, and the kernel's sign there (0: unknown)."""
    offset = np.fft.fftfreq(padded, 1 / padded).round().astype(np.int64)
    size = np.abs(offset)
    sign = np.sign(offset).astype(np.float64) if odd else np.ones(padded)
    if odd and padded % 2 == 0:
        sign[padded // 2] = 0.0
    return np.minimum(size, known - 1), np.where(size < known, sign, 0.0)
