"""The layer's answer to the load on one cell: real-space kernels on a grid, for a layer without end.

A Fourier sum repeats the load with its period. The kernels fade within some thicknesses, so for a thin layer a period
a little beyond the grid is enough. A thick layer's fade slowly; there, long waves are summed with ever larger
periods and few of them, which costs next to nothing and leaves no trace of the repetition.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.kernels import layer_compliances
from cmpdesign.contact.elastomer import Elastomer

Array = NDArray[np.float64]
# Thicknesses within which the kernels fade to 2e-4 of their value at one thickness: they go with exp(-0.739 r / h), as
# cosh kh = +- i kh, where D = 0 for nu = 1/2, has its first root at 0.739 i.
KERNEL_REACH_THICKNESSES = 12.0
# Waves of a period that the next, four times larger one takes over: exp(-(k / kc)^4) with kc = CUT steps.
CUTOFF_WAVES, PERIOD_GROWTH, NEGLIGIBLE_CUTOFFS = 12, 4, 2.25


@dataclass(frozen=True)
class GreenKernels:
    """Displacement in mm at offsets (row, column) >= 0 cells for 1 MPa on one cell; the rest by symmetry.

    Attributes:
        elastomer: the layer.
        zz, xx, yy, xy, xz, yz: (n, n) each; xz is u_x for t_z, odd in x. u_z for t_x is its negative.
        step_mm: the grid's step.
        reach: cells beyond which all of them are negligible.
    """

    elastomer: Elastomer
    zz: Array
    xx: Array
    yy: Array
    xy: Array
    xz: Array
    yz: Array
    step_mm: float
    reach: int


@lru_cache(maxsize=8)
def green_kernels(elastomer: Elastomer, step_mm: float, cells: int) -> GreenKernels:
    """The kernels for offsets up to ``cells`` - 1 in both directions."""
    reach = int(np.ceil(KERNEL_REACH_THICKNESSES * elastomer.thickness_mm / step_mm))
    offsets = np.asarray(step_mm * np.arange(cells), dtype=np.float64)
    half = (cells + min(cells, reach)) // 2 + 1
    period = (2 * half + 1) * step_mm
    total = np.zeros((4, cells, cells))
    inherited = None
    while True:
        last = period - cells * step_mm >= reach * step_mm
        dk = 2 * np.pi / period
        cut = None if last else CUTOFF_WAVES * dk
        total += _sum_waves(elastomer, offsets, dk, half, inherited, cut) * step_mm**2
        if cut is None:
            break
        inherited, period = cut, PERIOD_GROWTH * period
        half = int(np.ceil(NEGLIGIBLE_CUTOFFS * CUTOFF_WAVES * PERIOD_GROWTH))
    zz, xx, xy, xz = total
    for kernel in (zz, xx, xy, xz):
        kernel.setflags(write=False)
    return GreenKernels(
        elastomer=elastomer, zz=zz, xx=xx, yy=xx.T, xy=xy, xz=xz, yz=xz.T, step_mm=step_mm, reach=reach
    )


def _sum_waves(
    elastomer: Elastomer, offsets: Array, dk: float, half: int, inherited: float | None, cut: float | None
) -> Array:
    """zz, xx, xy, xz (4, n, n) from the waves (i, j) dk with \\|i\\|, \\|j\\| <= half, between two cut-offs."""
    k = dk * np.arange(half + 1)
    kx, ky = np.meshgrid(k, k)
    length = np.hypot(kx, ky)
    c = layer_compliances(length, elastomer)
    weight = np.where(kx > 0, 2.0, 1.0) * np.where(ky > 0, 2.0, 1.0) * (dk / (2 * np.pi)) ** 2
    if cut is not None:
        weight = -weight * np.expm1(-((length / cut) ** 4))
    if inherited is not None:
        weight = weight * np.exp(-((length / inherited) ** 4))
    shortest = np.pi / (offsets[1] - offsets[0])
    unit = np.where(length > 0, length, 1.0)
    nx, ny = kx / unit, ky / unit
    # For nu < 1/2 xz does not fade towards the grid's shortest waves and would ring; Lanczos' factor calms it.
    calm = np.sinc(kx / shortest) * np.sinc(ky / shortest)
    cos, sin = np.cos(np.outer(offsets, k)), np.sin(np.outer(offsets, k))
    zz = cos @ (weight * c.zz) @ cos.T
    xx = cos @ (weight * (nx**2 * c.ll + ny**2 * c.sh + (length == 0) * c.ll)) @ cos.T
    xy = -sin @ (weight * nx * ny * (c.ll - c.sh)) @ sin.T
    xz = -cos @ (weight * calm * nx * c.xz) @ sin.T
    return np.stack([zz, xx, xy, xz])
