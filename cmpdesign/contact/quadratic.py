"""Contact as a quadratic program: conjugate gradients on the free tractions, projection onto what friction allows.

Minimise  1/2 t.Ct - t.b  over  t_z <= 0 (no adhesion)  and  |(t_x, t_y)| <= limit  in every cell. Its gradient Ct - b
is the gap that is left: 0 where tractions are free, of one sign where they are not. This is the conjugate gradient
method with an active set of Polonsky & Keer (Wear 231, 1999) and Rey, Anciaux & Molinari (Comput. Mech. 60, 2017), with
the rule of Dostal's MPRGP for when to let bound tractions go.

Coulomb's limit is the friction coefficient times the pressure that is sought. It is renewed from the pressure so far
while the iteration runs, which ends when the limit is steady too: Panagiotopoulos' fixed point (1975), but not solved
out for every limit on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MOST_ITERATIONS = 2000
# Applications of the operator between two renewals of the limit, and the change of the limit that is taken for none.
RENEW_AFTER, STEADY = 10, 5e-4
# Gradient steps are this long over the largest eigenvalue; up to 2 they descend.
STEP = 1.9


class Allowed(Protocol):
    """The set of tractions to choose from."""

    @property
    def limit_mpa(self) -> Array:
        """The most shear in every cell."""

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""

    def free(self, t: Array) -> Mask:
        """Components that may move both ways."""

    def renewed(self, t: Array) -> Self:
        """The set with its limits taken from these tractions."""

    def change(self, t: Array) -> float:
        """How far that would move the limits, as a share of them."""


@dataclass(frozen=True)
class Friction:
    """Tractions (3, rows, columns): pressure where ``touchable``, shear up to ``limit_mpa``."""

    touchable: Mask
    coefficient: float
    limit_mpa: Array

    @classmethod
    def at(cls, touchable: Mask, coefficient: float, traction_z_mpa: Array) -> Self:
        """With the limit of these pressures; without limit where they press if the coefficient is infinite."""
        pressed = traction_z_mpa < 0
        if np.isinf(coefficient):
            return cls(touchable, coefficient, np.where(pressed, np.inf, 0.0))
        return cls(touchable, coefficient, np.where(pressed, -coefficient * traction_z_mpa, 0.0))

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""
        found = np.empty_like(t)
        found[2] = np.where(self.touchable, np.minimum(t[2], 0.0), 0.0)
        size = np.hypot(t[0], t[1])
        over = size > self.limit_mpa
        shrink = np.where(over, self.limit_mpa, 1.0) / np.where(over, size, 1.0)
        found[:2] = t[:2] * shrink
        return found

    def free(self, t: Array) -> Mask:
        """Where it sticks, and where it presses."""
        sticks = np.hypot(t[0], t[1]) < self.limit_mpa * (1 - 1e-12)
        return np.stack([sticks, sticks, t[2] < 0])

    def renewed(self, t: Array) -> Self:
        """With the limit of these tractions' pressure."""
        return self.at(self.touchable, self.coefficient, t[2])

    def change(self, t: Array) -> float:
        """Sum of the limit's changes over its sum; of cells, where there is no limit."""
        new, old = self.renewed(t).limit_mpa, self.limit_mpa
        if np.isinf(self.coefficient):
            return float(np.count_nonzero(new != old) / max(int(np.count_nonzero(old)), 1))
        return float(np.abs(new - old).sum() / max(float(old.sum()), 1e-300))


@dataclass(frozen=True)
class Pressure:
    """Pressure alone: tractions (rows, columns), z only."""

    touchable: Mask

    @property
    def limit_mpa(self) -> Array:
        """No shear."""
        return np.zeros(self.touchable.shape)

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""
        return np.where(self.touchable, np.minimum(t, 0.0), 0.0)

    def free(self, t: Array) -> Mask:
        """Where it presses."""
        return np.asarray(t < 0)

    def renewed(self, t: Array) -> Self:
        """Itself: nothing here depends on the tractions."""
        return self

    def change(self, t: Array) -> float:
        """None."""
        return 0.0


class Minimum(NamedTuple):
    """Tractions, what they were allowed at last, applications of C, and the gap that is left in mm (RMS).

    The gap is above the tolerance only if the iteration did not converge.
    """

    traction_mpa: Array
    allowed: Allowed
    applied: int
    left_mm: float


def minimise(
    apply: Callable[[Array], Array],
    b: Array,
    allowed: Allowed,
    t: Array,
    *,
    largest: float,
    tolerance_mm: float,
) -> Minimum:
    """Tractions that leave no more than ``tolerance_mm`` of gap, as a root mean square over the loaded cells.

    Args:
        apply: the operator C; ``largest`` is at least its largest eigenvalue.
        b: the displacement that the object asks for, shaped as t.
        t: where to start.
    """
    step = STEP / largest
    t = allowed.project(t)
    gap = apply(t) - b
    applied, renewed, ahead, before = 1, 0, None, 1.0
    while True:
        free = allowed.free(t)
        to_go = (t - allowed.project(t - gap / largest)) * largest
        left = float(np.sqrt(np.sum(to_go**2) / max(int(np.count_nonzero(free)), 1)))
        done = left <= tolerance_mm
        if applied >= MOST_ITERATIONS or (done and allowed.change(t) <= STEADY):
            return Minimum(t, allowed, applied, left)
        if done or (ahead is None and applied - renewed >= RENEW_AFTER):
            allowed = allowed.renewed(t)
            t, renewed, ahead = allowed.project(t), applied, None
            gap = apply(t) - b
            applied += 1
            free = allowed.free(t)
            to_go = (t - allowed.project(t - gap / largest)) * largest
        inside = np.where(free, gap, 0.0)
        strength = float(np.sum(inside * inside))
        if float(np.sum(np.where(free, 0.0, to_go) ** 2)) > strength:  # the free set is wrong: let go
            t, ahead = allowed.project(t - step * gap), None
            gap = apply(t) - b
            applied += 1
            continue
        ahead = inside if ahead is None else np.where(free, inside + strength / before * ahead, 0.0)
        before = strength
        answer = apply(ahead)
        applied += 1
        way = float(np.sum(inside * ahead)) / float(np.sum(ahead * answer))
        full = t - way * ahead
        cut = allowed.project(full)
        if np.array_equal(cut, full):
            t, gap = full, gap - way * answer
            continue
        cut = allowed.project(cut - step * (apply(cut) - b))
        new_gap, ahead = apply(cut) - b, None
        applied += 2
        if np.sum(cut * (new_gap - b)) > np.sum(t * (gap - b)):  # twice the energy; a gradient step lowers it
            cut = allowed.project(t - step * gap)
            new_gap = apply(cut) - b
            applied += 1
        t, gap = cut, new_gap
