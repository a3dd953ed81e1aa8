"""Lenses: from the direction of a ray to its place in the image, with derivatives, and the exact inverse.

A direction is (x, y) = (X / Z, Y / Z) in the camera's frame, so that a lens sees less than 180 degrees. The models and
the order of their coefficients are OpenCV's. With r^2 = x^2 + y^2, a "perspective" lens of 5, 8 or 12 coefficients
k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, of which absent ones are 0, has

    radial = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
    x' = x radial + 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2 + s2 r^4
    y' = y radial + p1 (r^2 + 2 y^2) + 2 p2 x y + s3 r^2 + s4 r^4

A "fisheye" lens of 4 coefficients (Kannala and Brandt, PAMI 28 (2006) 1335) has, with t = atan r,

    (x', y') = (x, y) t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) / r

A model is valid up to its fold radius, at which the radial part turns back or has a pole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import space as native

Array = NDArray[np.float64]
LensKind = Literal["perspective", "fisheye"]

COUNTS: dict[LensKind, tuple[int, ...]] = {"perspective": (5, 8, 12), "fisheye": (4,)}
NAMES: dict[LensKind, tuple[str, ...]] = {
    "perspective": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}
REAL_ROOT = 1e-9  # imaginary part of a real root, relative to the root


class Distorted(NamedTuple):
    """N places in the image, in focal lengths from the principal point.

    Attributes:
        xy: (N, 2) float64.
        by_direction: (N, 2, 2) float64.
    """

    xy: Array
    by_direction: Array


class LensTable(NamedTuple):
    """A lens for native loops, with 12 coefficients."""

    is_fisheye: bool
    k: tuple[float, ...]
    fold_radius: float


@dataclass(frozen=True)
class Lens:
    """A lens, see the module.

    Attributes:
        kind: the model.
        coefficients: as many as ``COUNTS`` allows.
    """

    kind: LensKind
    coefficients: tuple[float, ...]

    @cached_property
    def fold_radius(self) -> float:
        """The radius of directions up to which the lens is valid; infinite without a limit."""
        if self.kind == "fisheye":
            slope = [(2 * i + 1) * k for i, k in enumerate((1.0, *self.coefficients))]
            square = _least_positive_root(np.array(slope))
            return float(np.tan(np.sqrt(square))) if square < (np.pi / 2) ** 2 else np.inf
        k1, k2, _, _, k3, k4, k5, k6, *_ = self._all_coefficients
        above, below = np.array([1.0, k1, k2, k3]), np.array([1.0, k4, k5, k6])
        powers = np.arange(4)
        # d (r N / D) / dr = 0 in s = r^2: (N + 2 s N') D - 2 s N D'
        turn = np.convolve((1 + 2 * powers) * above, below) - np.convolve(above, 2 * powers * below)
        return float(np.sqrt(min(_least_positive_root(turn), _least_positive_root(below))))

    @property
    def _all_coefficients(self) -> tuple[float, ...]:
        return (*self.coefficients, *(12 - len(self.coefficients)) * (0.0,))

    @cached_property
    def native(self) -> LensTable:
        """What native loops read."""
        return LensTable(self.kind == "fisheye", self._all_coefficients, self.fold_radius)

    def distort(self, direction: Array) -> Distorted:
        """The places of directions (N, 2), and their derivatives."""
        return native.distort(self.native, np.ascontiguousarray(direction, np.float64))

    def by_coefficients(self, direction: Array) -> Array:
        """(N, 2, K) derivatives of the places of directions (N, 2) by the coefficients."""
        x, y = direction.T
        square, zero = x * x + y * y, np.zeros_like(x)
        if self.kind == "fisheye":
            angle, share = _angle_and_share(square)
            powers = angle[:, None] ** np.array([2, 4, 6, 8])
            return np.asarray(direction[:, :, None] * (share[:, None] * powers)[:, None, :])
        powers = np.column_stack([square, square**2, square**3])
        above, below = self._above_and_below(square)
        factor = above / below
        radial = np.concatenate([powers, -factor[:, None] * powers], axis=1) / below[:, None]
        columns = np.empty((len(x), 2, 12))
        columns[:, :, [0, 1, 4, 5, 6, 7]] = direction[:, :, None] * radial[:, None, :]
        columns[:, 0, 2:4] = np.column_stack([2 * x * y, square + 2 * x * x])
        columns[:, 1, 2:4] = np.column_stack([square + 2 * y * y, 2 * x * y])
        columns[:, 0, 8:] = np.column_stack([square, square**2, zero, zero])
        columns[:, 1, 8:] = np.column_stack([zero, zero, square, square**2])
        return columns[:, :, : len(self.coefficients)]

    def _above_and_below(self, square: Array) -> tuple[Array, Array]:
        """(N,) numerator and denominator of the radial factor."""
        k1, k2, _, _, k3, k4, k5, k6, *_ = self._all_coefficients
        above = 1 + square * (k1 + square * (k2 + square * k3))
        return above, 1 + square * (k4 + square * (k5 + square * k6))

    def undistort(self, xy: Array) -> Array:
        """(N, 2) directions of places (N, 2), by damped Newton steps to 1e-13; NaN without an inverse.

        The usual fixed-point iteration may diverge at strong distortion without an error. A result of this function
        lies within the fold radius and is mapped onto the input again.
        """
        if self.kind == "perspective" and not any(self.coefficients):
            return xy.copy()
        return native.undistort(self.native, np.ascontiguousarray(xy, np.float64))


def _angle_and_share(square: Array) -> tuple[Array, Array]:
    """(N,) t = atan r, and t / r, of the squares of r."""
    radius = np.sqrt(square)
    angle = np.arctan(radius)
    return angle, np.divide(angle, radius, out=np.ones_like(radius), where=radius > 0)


def _least_positive_root(polynomial: Array) -> float:
    """The least positive root of a polynomial whose lowest coefficient comes first and is not 0; inf without one."""
    inverse = np.roots(polynomial)  # in 1 / s, so that weak coefficients do not overflow
    real = inverse.real[abs(inverse.imag) <= REAL_ROOT * abs(inverse)]
    largest = float(real.max(initial=0.0))
    return 1 / largest if largest > 1e-12 else np.inf
