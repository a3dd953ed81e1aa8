"""The lens: places of points, spread of light, and loss of light in the corners."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import SIZE_PX, Lens

Points = NDArray[np.float64]
Planes = NDArray[np.float32]
CENTRE_PX = np.array([(SIZE_PX[0] - 1) / 2, (SIZE_PX[1] - 1) / 2])
CORNER_PX = float(np.hypot(*CENTRE_PX))  # distance of the image's corners from its centre
BLOOM_SIGMA_PX = (12.0, 48.0)  # of the two halves of the light that is scattered far
BLOOM_STEP = 4  # px, the grid on which scattered light is computed
KERNEL_SAMPLES_PER_PX = 8


def lens_map(lens: Lens, channel: int | None) -> Callable[[Points], Points]:
    """The map from px of a perfect lens to px of this lens, (N, 2) to (N, 2).

    Args:
        lens: the lens.
        channel: 0 blue, 1 green, 2 red. None or 1: without the chromatic aberration.
    """
    outward = {0: -1.0, 2: 1.0}.get(1 if channel is None else channel, 0.0)
    magnification = 1.0 + outward * lens.aberration_px / CORNER_PX

    def mapped(xy_px: Points) -> Points:
        offset = xy_px - CENTRE_PX
        squared = (offset**2).sum(axis=-1, keepdims=True) / CORNER_PX**2
        return np.asarray(CENTRE_PX + magnification * offset * (1.0 + lens.distortion * squared))

    return mapped


def spread_light(planes: Planes, lens: Lens) -> Planes:
    """(3, H, W): light after defocus, motion, bloom and vignetting. All kernels are symmetric: no edge moves."""
    for kernel in (
        disc_kernel(lens.defocus_px) if lens.defocus_px else None,
        line_kernel(lens.motion_px, lens.motion_deg) if lens.motion_px else None,
    ):
        if kernel is not None:
            planes = np.stack(
                [cv2.filter2D(plane, -1, kernel, borderType=cv2.BORDER_REPLICATE) for plane in planes]
            )
    if lens.bloom:
        planes = np.float32(1.0 - lens.bloom) * planes + np.float32(lens.bloom) * _scattered(planes)
    if lens.vignetting:
        planes = planes * vignetting_gain(lens.vignetting)
    return np.asarray(planes, dtype=np.float32)


def vignetting_gain(loss: float) -> Planes:
    """(H, W) float32: 1 in the centre, 1 - ``loss`` in the corners, by the law of cos^4."""
    x = np.arange(SIZE_PX[0])[None, :] - CENTRE_PX[0]
    y = np.arange(SIZE_PX[1])[:, None] - CENTRE_PX[1]
    tangent_squared = (1.0 - loss) ** -0.5 - 1.0
    return np.asarray((1.0 + tangent_squared * (x**2 + y**2) / CORNER_PX**2) ** -2.0, dtype=np.float32)


def disc_kernel(radius_px: float) -> Planes:
    """(n, n) float32, sum 1: a disc of light, its points shared between pixels linearly."""
    steps = np.arange(-np.ceil(radius_px), np.ceil(radius_px) + 1e-9, 1 / KERNEL_SAMPLES_PER_PX)
    x, y = np.meshgrid(steps, steps)
    inside = x**2 + y**2 <= radius_px**2
    return _kernel(np.stack([x[inside], y[inside]], axis=1))


def line_kernel(length_px: float, direction_deg: float) -> Planes:
    """(n, n) float32, sum 1: a line of light through the kernel's centre, its points shared between pixels linearly."""
    along = np.linspace(-0.5, 0.5, 2 * int(np.ceil(KERNEL_SAMPLES_PER_PX * length_px)) + 1) * length_px
    angle = np.radians(direction_deg)
    return _kernel(along[:, None] * np.array([np.cos(angle), -np.sin(angle)]))


def _kernel(points: Points) -> Planes:
    reach = int(np.ceil(np.abs(points).max())) + 1
    size = 2 * reach + 1
    first = np.floor(points).astype(np.int64)
    share = points - first
    kernel = np.zeros(size * size)
    for right in (0, 1):
        for below in (0, 1):
            weight = np.abs(1 - right - share[:, 0]) * np.abs(1 - below - share[:, 1])
            index = (first[:, 1] + below + reach) * size + first[:, 0] + right + reach
            kernel += np.bincount(index, weight, minlength=size * size)
    return np.asarray((kernel / kernel.sum()).reshape(size, size), dtype=np.float32)


def _scattered(planes: Planes) -> Planes:
    width, height = SIZE_PX
    small_size = (width // BLOOM_STEP, height // BLOOM_STEP)
    scattered = []
    for plane in planes:
        small = cv2.resize(plane, small_size, interpolation=cv2.INTER_AREA)
        both = [cv2.GaussianBlur(small, (0, 0), sigma / BLOOM_STEP) for sigma in BLOOM_SIGMA_PX]
        scattered.append(
            cv2.resize(0.5 * (both[0] + both[1]), (width, height), interpolation=cv2.INTER_LINEAR)
        )
    return np.asarray(np.stack(scattered), dtype=np.float32)
