"""The optics: a Gaussian blur and the pixel's box, as weights of cubic B-splines.

A pixel is the integral of the scene over its box, after a Gaussian blur. Coverage that is sampled by boxes
and blurred afterwards has an error of up to a twelfth of a square pixel in the squared blur, because boxes partly lose
the position of an edge inside a pixel. Therefore coverage is sampled by cubic B-splines (exactly, see ``coverage``).
The point spread, box * Gaussian, is approximated by a sum of these splines: a least-squares fit with at least 1.2
samples per sigma.

The remaining error for every blur from 0.1 to 20 px: less than 5e-4 of the height of an edge's profile, and
less than 2e-4 px of its position. A test measures both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError

SAMPLES_PER_SIGMA = 1.2
REACH_SIGMA = 5.5  # extent of the point spread


@dataclass(frozen=True)
class Optics:
    """Gaussian blur; ``blur_px`` is the sigma, 0 or 0.1 to 20 px."""

    __pydantic_config__: ClassVar = STRICT

    blur_px: float = 1.0

    def __post_init__(self) -> None:
        if not (self.blur_px == 0 or 0.1 <= self.blur_px <= 20):
            raise SceneError(f"blur_px is {self.blur_px:g}; it must be 0 or lie between 0.1 and 20 px")


@dataclass(frozen=True, eq=False)
class PointSpread:
    """A point spread function as a sum of B-splines.

    Attributes:
        degree: the splines' degree: 0 (only the pixel's box) or 3.
        oversampling: spline samples per pixel, along x and y.
        weights: (2 * reach + 1,) float32, of the samples around the pixel's centre; their sum is 1.
    """

    degree: int
    oversampling: int
    weights: NDArray[np.float32]

    @property
    def reach(self) -> int:
        return len(self.weights) // 2


@lru_cache(maxsize=64)
def make_point_spread(blur_px: float) -> PointSpread:
    """The point spread of a blur; the pixel's box alone for blur 0."""
    if blur_px == 0:
        return PointSpread(0, 1, np.ones(1, dtype=np.float32))
    oversampling = int(np.ceil(SAMPLES_PER_SIGMA / blur_px - 1e-9))
    reach = int(np.ceil((REACH_SIGMA * blur_px + 1.0) * oversampling))
    centres = np.arange(-reach, reach + 1)
    positions = np.arange(-(reach + 2) * 32, (reach + 2) * 32 + 1) / 32
    splines = cubic_spline(positions[:, None] - centres) * oversampling
    weights = np.linalg.lstsq(splines, box_gaussian(positions / oversampling, blur_px), rcond=None)[0]
    weights = 0.5 * (weights + weights[::-1])
    return PointSpread(3, oversampling, (weights / weights.sum()).astype(np.float32))


def cubic_spline(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """The centred cubic B-spline of unit area."""
    distance = np.abs(x)
    inner = 2 / 3 - distance**2 + distance**3 / 2
    outer = np.maximum(2 - distance, 0) ** 3 / 6
    return np.where(distance < 1, inner, outer)


def box_gaussian(x: NDArray[np.float64], blur_px: float) -> NDArray[np.float64]:
    """The exact point spread along one axis: a unit box convolved with a Gaussian of sigma ``blur_px``."""
    root = math.sqrt(2) * blur_px
    return np.asarray(0.5 * (_ERF((x + 0.5) / root) - _ERF((x - 0.5) / root)))


_ERF = np.vectorize(math.erf, otypes=[np.float64])
