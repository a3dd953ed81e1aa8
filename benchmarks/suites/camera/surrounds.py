"""Surrounds of the pattern as reflectances: one color, wood-like, skin-like."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import SIZE_PX, Surround

Planes = NDArray[np.float32]
RING_PX = 14.0  # mean distance of the rings of wood
GRAIN_RGB = (0.5, 0.4, 0.3)  # contrast of the rings of wood in each channel, as logarithms


def surround_planes(surround: Surround, rng: np.random.Generator) -> Planes:
    """(3, H, W) float32 reflectance, channels B, G, R."""
    width, height = SIZE_PX
    plain = np.asarray(surround.rgb[::-1], dtype=np.float32)[:, None, None]
    if surround.kind == "plain" or not surround.texture:
        return np.broadcast_to(plain, (3, height, width))
    if surround.kind == "wood":
        pattern = _rings(rng)
        contrast = np.asarray(GRAIN_RGB[::-1], dtype=np.float32)[:, None, None]
    else:
        pattern = 0.7 * _smooth_noise(rng, 30.0) + 0.5 * _smooth_noise(rng, 2.0)
        contrast = np.asarray((0.25, 0.2, 0.1), dtype=np.float32)[:, None, None]
    return np.asarray(plain * np.exp(np.float32(surround.texture) * contrast * pattern), dtype=np.float32)


def _rings(rng: np.random.Generator) -> Planes:
    """(H, W), about -1 to 1: bent lines of changing width along a random direction, with fine fibres."""
    width, height = SIZE_PX
    angle = rng.uniform(0, np.pi)
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    across = x * np.float32(np.cos(angle)) + y * np.float32(np.sin(angle))
    bent = across / RING_PX + 1.5 * _smooth_noise(rng, 50.0)
    return np.asarray(np.sin(2 * np.pi * bent) * 0.7 + 0.3 * _smooth_noise(rng, 1.0), dtype=np.float32)


def _smooth_noise(rng: np.random.Generator, sigma_px: float) -> Planes:
    """(H, W) noise of unit deviation with a Gaussian correlation."""
    width, height = SIZE_PX
    step = max(int(sigma_px / 4), 1)
    shape = (height // step + 2, width // step + 2)
    noise = cv2.GaussianBlur(rng.standard_normal(shape, dtype=np.float32), (0, 0), sigma_px / step)
    scaled = cv2.resize(noise / noise.std(), (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(scaled, dtype=np.float32)
