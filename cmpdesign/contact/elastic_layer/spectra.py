"""The elastic layer's response wave by wave, as one compiled pass over memory."""

from __future__ import annotations

from typing import Any

from numba import njit
from numpy.typing import NDArray


@njit(cache=True, fastmath=True)
def update_load_spectra(
    loads: NDArray[Any],
    xx: NDArray[Any],
    yy: NDArray[Any],
    zz: NDArray[Any],
    xy: NDArray[Any],
    xz: NDArray[Any],
    yz: NDArray[Any],
) -> None:
    """Replace the spectra of tractions by the spectra of displacements, in place.

    Args:
        loads: (3, rows, columns, 2), real and imaginary parts.
        xx, yy, zz, xy, xz, yz: (rows, columns) spectra of the kernels, see ``operator.KernelSpectra``.
    """
    for row in range(loads.shape[1]):
        for at in range(loads.shape[2]):
            x, y, z = loads[0, row, at, 0], loads[1, row, at, 0], loads[2, row, at, 0]
            ix, iy, iz = loads[0, row, at, 1], loads[1, row, at, 1], loads[2, row, at, 1]
            plane, a, b = xy[row, at], xz[row, at], yz[row, at]
            loads[0, row, at, 0] = xx[row, at] * x + plane * y - a * iz
            loads[0, row, at, 1] = xx[row, at] * ix + plane * iy + a * z
            loads[1, row, at, 0] = plane * x + yy[row, at] * y - b * iz
            loads[1, row, at, 1] = plane * ix + yy[row, at] * iy + b * z
            loads[2, row, at, 0] = a * ix + b * iy + zz[row, at] * z
            loads[2, row, at, 1] = zz[row, at] * iz - a * x - b * y
