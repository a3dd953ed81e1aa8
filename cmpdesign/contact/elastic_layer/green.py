"""Green's functions of the elastic layer: displacement kernels of a loaded cell, on a grid of an unbounded layer.

A Fourier sum repeats the load with its period. The kernels decay within some thicknesses, so for a thin elastic layer a
period slightly larger than the grid is sufficient. The kernels of a thick elastic layer decay slowly. For these the
long waves are summed in further passes with ever larger periods and few waves each. This costs little, and the
periodic images of the load vanish.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.kernels import interior_compliances, layer_compliances
from cmpdesign.contact.elastomer import Elastomer

Array = NDArray[np.float64]
# Thicknesses within which the kernels decay to 2e-4 of their value at one thickness. They decay as exp(-0.739 r / h):
# cosh kh = +- i kh, the condition D = 0 for nu = 1/2, has its first root at 0.739 i.
KERNEL_REACH_THICKNESSES = 12.0
# Long waves are left to the next period, four times larger: they are weighted by 1 - exp(-(k / kc)^4), with kc =
# CUTOFF_WAVES wave number intervals; beyond NEGLIGIBLE_CUTOFFS * kc the next period's waves do not count.
CUTOFF_WAVES, PERIOD_GROWTH, NEGLIGIBLE_CUTOFFS = 12, 4, 2.25


@dataclass(frozen=True)
class GreenKernels:
    """Displacement in mm at offsets (row, column) >= 0 cells for 1 MPa on one cell. Other offsets follow by symmetry.

    Attributes:
        elastomer: the elastic layer.
        zz, xx, yy, xy, xz, yz: (n, n) float64 each; xz is u_x for t_z, odd in x.
        zx, zy: (n, n) float64; minus u_z for t_x, odd in x. At the surface they are xz and yz.
        step_mm: the grid's spacing.
        reach: offset in cells beyond which all kernels are negligible.
    """

    elastomer: Elastomer
    zz: Array
    xx: Array
    yy: Array
    xy: Array
    xz: Array
    yz: Array
    zx: Array
    zy: Array
    step_mm: float
    reach: int


@lru_cache(maxsize=8)
def green_kernels(
    elastomer: Elastomer, step_mm: float, cells: int, depth_mm: float | None = None
) -> GreenKernels:
    """The kernels for offsets up to ``cells`` - 1 in both directions.

    Args:
        elastomer: the elastic layer.
        step_mm: the grid's spacing.
        cells: cells along the longer side of the grid.
        depth_mm: depth at which the displacement is, from 0 to the thickness; None: at the surface, by the closed form.
    """
    reach = int(np.ceil(KERNEL_REACH_THICKNESSES * elastomer.thickness_mm / step_mm))
    offsets = np.asarray(step_mm * np.arange(cells), dtype=np.float64)
    wave_count = (cells + min(cells, reach)) // 2 + 1
    period = (2 * wave_count + 1) * step_mm
    total = np.zeros((5, cells, cells))
    previous_cutoff = None
    while True:
        is_last = period - cells * step_mm >= reach * step_mm
        dk = 2 * np.pi / period
        cutoff = None if is_last else CUTOFF_WAVES * dk
        total += (
            _sum_waves(elastomer, depth_mm, offsets, dk, wave_count, (previous_cutoff, cutoff)) * step_mm**2
        )
        if cutoff is None:
            break
        previous_cutoff, period = cutoff, PERIOD_GROWTH * period
        wave_count = int(np.ceil(NEGLIGIBLE_CUTOFFS * CUTOFF_WAVES * PERIOD_GROWTH))
    total.setflags(write=False)
    zz, xx, xy, xz, zx = total
    return GreenKernels(
        elastomer=elastomer,
        zz=zz,
        xx=xx,
        yy=xx.T,
        xy=xy,
        xz=xz,
        yz=xz.T,
        zx=zx,
        zy=zx.T,
        step_mm=step_mm,
        reach=reach,
    )


def _sum_waves(
    elastomer: Elastomer,
    depth_mm: float | None,
    offsets: Array,
    dk: float,
    wave_count: int,
    cutoffs: tuple[float | None, float | None],
) -> Array:
    """zz, xx, xy, xz, zx (5, n, n) from the waves (i, j) dk with \\|i\\|, \\|j\\| <= half, between two cut-offs."""
    previous_cutoff, cutoff = cutoffs
    k = dk * np.arange(wave_count + 1)
    kx, ky = np.meshgrid(k, k)
    wave_number = np.hypot(kx, ky)
    if depth_mm is None:
        c = layer_compliances(wave_number, elastomer)
    else:
        c = interior_compliances(wave_number, elastomer, depth_mm)
    weight = np.where(kx > 0, 2.0, 1.0) * np.where(ky > 0, 2.0, 1.0) * (dk / (2 * np.pi)) ** 2
    if cutoff is not None:
        weight = -weight * np.expm1(-((wave_number / cutoff) ** 4))
    if previous_cutoff is not None:
        weight = weight * np.exp(-((wave_number / previous_cutoff) ** 4))
    nyquist = np.pi / (offsets[1] - offsets[0])
    divisor = np.where(wave_number > 0, wave_number, 1.0)
    nx, ny = kx / divisor, ky / divisor
    # For nu < 1/2 xz does not decay towards the grid's shortest waves; Lanczos' factor suppresses the ringing.
    lanczos = np.sinc(kx / nyquist) * np.sinc(ky / nyquist)
    cos, sin = np.cos(np.outer(offsets, k)), np.sin(np.outer(offsets, k))
    zz = cos @ (weight * c.zz) @ cos.T
    xx = cos @ (weight * (nx**2 * c.ll + ny**2 * c.sh + (wave_number == 0) * c.ll)) @ cos.T
    xy = -sin @ (weight * nx * ny * (c.ll - c.sh)) @ sin.T
    xz = -cos @ (weight * lanczos * nx * c.xz) @ sin.T
    zx = xz if depth_mm is None else -cos @ (weight * lanczos * nx * c.zx) @ sin.T
    return np.stack([zz, xx, xy, xz, zx])
