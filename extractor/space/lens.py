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

Array = NDArray[np.float64]
LensKind = Literal["perspective", "fisheye"]

COUNTS: dict[LensKind, tuple[int, ...]] = {"perspective": (5, 8, 12), "fisheye": (4,)}
NAMES: dict[LensKind, tuple[str, ...]] = {
    "perspective": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}
MAX_ITERATIONS = 60  # of Newton's method
CONVERGED = 1e-13  # error in normalised coordinates, far below the accuracy of a pixel
ACCEPTED = 1e-9  # error in normalised coordinates above which a point has no inverse
MAX_HALVINGS = 12  # of a Newton step
REAL_ROOT = 1e-9  # imaginary part of a real root, relative to the root
START_RAD = 1.5  # largest angle from the axis at which the inverse of a fisheye lens starts
AXIS = 1e-4  # radius below which t / r is a series


class Distorted(NamedTuple):
    """N places in the image, in focal lengths from the principal point.

    Attributes:
        xy: (N, 2) float64.
        by_direction: (N, 2, 2) float64.
    """

    xy: Array
    by_direction: Array


class _Radial(NamedTuple):
    """The radial factor of N points, and its derivative by r^2."""

    factor: Array
    by_square: Array


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

    def distort(self, direction: Array) -> Distorted:
        """The places of directions (N, 2), and their derivatives."""
        x, y = direction.T
        radial = self._fisheye(x * x + y * y) if self.kind == "fisheye" else self._rational(x * x + y * y)
        by_direction = np.empty((len(x), 2, 2))
        slope = 2 * radial.by_square
        by_direction[:, 0, 0] = radial.factor + slope * x * x
        by_direction[:, 1, 1] = radial.factor + slope * y * y
        by_direction[:, 0, 1] = by_direction[:, 1, 0] = slope * x * y
        xy = direction * radial.factor[:, None]
        if self.kind == "perspective":
            self._add_decentring(x, y, xy, by_direction)
        return Distorted(xy, by_direction)

    def _add_decentring(self, x: Array, y: Array, xy: Array, by_direction: Array) -> None:
        p1, p2 = self.coefficients[2:4]
        s1, s2, s3, s4 = self._all_coefficients[8:]
        square = x * x + y * y
        xy[:, 0] += 2 * p1 * x * y + p2 * (square + 2 * x * x) + square * (s1 + s2 * square)
        xy[:, 1] += p1 * (square + 2 * y * y) + 2 * p2 * x * y + square * (s3 + s4 * square)
        prism_x, prism_y = 2 * (s1 + 2 * s2 * square), 2 * (s3 + 2 * s4 * square)
        by_direction[:, 0, 0] += 2 * p1 * y + 6 * p2 * x + prism_x * x
        by_direction[:, 0, 1] += 2 * p1 * x + 2 * p2 * y + prism_x * y
        by_direction[:, 1, 0] += 2 * p1 * x + 2 * p2 * y + prism_y * x
        by_direction[:, 1, 1] += 6 * p1 * y + 2 * p2 * x + prism_y * y

    def by_coefficients(self, direction: Array) -> Array:
        """(N, 2, K) derivatives of the places of directions (N, 2) by the coefficients."""
        x, y = direction.T
        square, zero = x * x + y * y, np.zeros_like(x)
        if self.kind == "fisheye":
            angle, share = _angle_and_share(square)
            powers = angle[:, None] ** np.array([2, 4, 6, 8])
            return np.asarray(direction[:, :, None] * (share[:, None] * powers)[:, None, :])
        powers = np.column_stack([square, square**2, square**3])
        _, below = self._above_and_below(square)
        factor = self._rational(square).factor
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

    def _rational(self, square: Array) -> _Radial:
        k1, k2, _, _, k3, k4, k5, k6, *_ = self._all_coefficients
        above, below = self._above_and_below(square)
        factor = above / below
        slope_above = k1 + square * (2 * k2 + 3 * k3 * square)
        slope_below = k4 + square * (2 * k5 + 3 * k6 * square)
        return _Radial(factor, (slope_above - factor * slope_below) / below)

    def _fisheye(self, square: Array) -> _Radial:
        angle, share = _angle_and_share(square)
        powers, k = angle[:, None] ** np.array([2, 4, 6, 8]), np.array(self.coefficients)
        slope = 1 + powers @ (k * [3, 5, 7, 9])  # of t (1 + k1 t^2 + ...) by t
        factor = share * (1 + powers @ k)
        near = square < AXIS**2
        # d (t_d / r) / d r^2 = (t_d' / (1 + r^2) - t_d / r) / (2 r^2)
        by_square = (slope / (1 + square) - factor) / (2 * np.where(near, 1.0, square))
        return _Radial(factor, np.where(near, k[0] - 1 / 3, by_square))

    def undistort(self, xy: Array) -> Array:
        """(N, 2) directions of places (N, 2), by damped Newton steps to 1e-13; NaN without an inverse.

        The usual fixed-point iteration may diverge at strong distortion without an error. A result of this function
        lies within the fold radius and is mapped onto the input again.
        """
        if self.kind == "perspective" and not any(self.coefficients):
            return xy.copy()
        radius = np.hypot(*xy.T)
        direction = xy * self._start_factor(radius)[:, None]
        error = np.full(len(xy), np.inf)
        for _ in range(MAX_ITERATIONS):
            found = self.distort(direction)
            residual = xy - found.xy
            error = np.hypot(*residual.T)
            active = np.flatnonzero(error > CONVERGED * (1 + radius))
            if not len(active):
                break
            step = _newton_step(residual[active], found.by_direction[active])
            moved = self._damped_step(direction[active], step, xy[active], error[active])
            if np.array_equal(moved, direction[active], equal_nan=True):
                break
            direction[active] = moved
        slopes = self.distort(direction).by_direction
        valid = (error < ACCEPTED * (1 + radius)) & (np.hypot(*direction.T) < self.fold_radius)
        valid &= np.linalg.det(np.where(np.isfinite(slopes), slopes, 0.0)) > 0
        direction[~valid] = np.nan
        return np.asarray(direction)

    def _start_factor(self, radius: Array) -> Array:
        """(N,) by which places at these distances from the axis are multiplied for a first direction."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            wanted = np.tan(np.minimum(radius, START_RAD)) if self.kind == "fisheye" else radius
            factor = np.minimum(wanted, 0.9 * self.fold_radius) / radius
        return np.where(radius == 0, 0.0, factor)

    def _damped_step(self, start: Array, step: Array, xy: Array, error: Array) -> Array:
        """(N, 2) directions after their steps, each halved until its ``error`` (N,) decreases within the fold radius.

        Directions whose error does not decrease are not moved.
        """
        moved = start.copy()
        waiting = np.isfinite(step).all(axis=1)
        for _ in range(MAX_HALVINGS):
            tried = start + step
            better = np.hypot(*(xy - self.distort(tried).xy).T) < error
            better &= waiting & (np.hypot(*tried.T) < self.fold_radius)
            moved[better] = tried[better]
            waiting &= ~better
            if not waiting.any():
                break
            step = 0.5 * step
        return moved


def _angle_and_share(square: Array) -> tuple[Array, Array]:
    """(N,) t = atan r, and t / r, of the squares of r."""
    radius = np.sqrt(square)
    angle, near = np.arctan(radius), radius < AXIS
    return angle, np.where(near, 1 - square / 3, angle / np.where(near, 1.0, radius))


def _least_positive_root(polynomial: Array) -> float:
    """The least positive root of a polynomial whose lowest coefficient comes first and is not 0; inf without one."""
    inverse = np.roots(polynomial)  # in 1 / s, so that weak coefficients do not overflow
    real = inverse.real[abs(inverse.imag) <= REAL_ROOT * abs(inverse)]
    largest = float(real.max(initial=0.0))
    return 1 / largest if largest > 1e-12 else np.inf


def _newton_step(residual: Array, derivatives: Array) -> Array:
    """(N, 2) solutions of 2 x 2 systems (N, 2, 2) for residuals (N, 2); not finite where singular."""
    (a, b), (c, d) = derivatives.transpose(1, 2, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        step = np.column_stack(
            [d * residual[:, 0] - b * residual[:, 1], a * residual[:, 1] - c * residual[:, 0]]
        )
        step /= (a * d - b * c)[:, None]
    return step
