"""Contact as a quadratic program: conjugate gradients on the free tractions, projection onto what friction allows.

Minimise  1/2 t.Ct - t.b  over  t_z <= 0 (no adhesion)  and  |(t_x, t_y)| <= limit  in every cell. Its gradient Ct - b
is the gap that is left: 0 where tractions are free, of one sign where they are not. This is the conjugate gradient
method with an active set of Polonsky & Keer (Wear 231, 1999) and Rey, Anciaux & Molinari (Comput. Mech. 60, 2017), with
the rule of Dostal's MPRGP for when to let bound tractions go.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MOST_ITERATIONS = 2000


@dataclass(frozen=True)
class Cone:
    """What tractions (3, rows, columns) are allowed: pressure where ``touchable``, shear up to ``limit_mpa``."""

    touchable: Mask
    limit_mpa: Array

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""
        found = np.empty_like(t)
        found[2] = np.where(self.touchable, np.minimum(t[2], 0.0), 0.0)
        size = np.hypot(t[0], t[1])
        over = size > self.limit_mpa
        found[:2] = t[:2] * np.where(over, self.limit_mpa / np.where(over, size, 1.0), 1.0)
        return found

    def free(self, t: Array) -> Mask:
        """Components (3, rows, columns) that may move both ways."""
        sticks = np.hypot(t[0], t[1]) < self.limit_mpa * (1 - 1e-12)
        return np.stack([sticks, sticks, t[2] < 0])


@dataclass(frozen=True)
class Pressure:
    """Pressure alone: tractions (rows, columns), z only."""

    touchable: Mask

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""
        return np.where(self.touchable, np.minimum(t, 0.0), 0.0)

    def free(self, t: Array) -> Mask:
        """Cells whose pressure may move both ways."""
        return np.asarray(t < 0)


def minimise(
    apply: Callable[[Array], Array],
    b: Array,
    allowed: Cone | Pressure,
    t: Array,
    *,
    largest: float,
    tolerance_mm: float,
) -> tuple[Array, int, float]:
    """Tractions that leave no more than ``tolerance_mm`` of gap, as a root mean square over the loaded cells.

    Args:
        apply: the operator C; ``largest`` is at least its largest eigenvalue.
        b: the displacement that the object asks for, shaped as t.
        t: where to start.

    Returns:
        Tractions, applications of C, and the gap that is left (above the tolerance only if it did not converge).
    """
    t = allowed.project(t)
    gap = apply(t) - b
    applied, ahead, before = 1, None, 1.0
    while True:
        free = allowed.free(t)
        to_go = largest * (t - allowed.project(t - gap / largest))
        left = float(np.sqrt(np.sum(to_go**2) / max(int(np.count_nonzero(free)), 1)))
        if left <= tolerance_mm or applied >= MOST_ITERATIONS:
            return t, applied, left
        inside = np.where(free, gap, 0.0)
        strength = float(np.sum(inside * inside))
        bound = float(np.sum(np.where(free, 0.0, to_go) ** 2))
        if bound > strength:  # the set of free tractions is wrong: let go
            t, ahead = allowed.project(t - gap / largest), None
            gap = apply(t) - b
            applied += 1
            continue
        ahead = inside if ahead is None else np.where(free, inside + strength / before * ahead, 0.0)
        before = strength
        answer = apply(ahead)
        applied += 1
        way = float(np.sum(inside * ahead)) / float(np.sum(ahead * answer))
        full = t - way * ahead
        t = allowed.project(full)
        if np.array_equal(t, full):
            gap = gap - way * answer
            continue
        t = allowed.project(t - (apply(t) - b) / largest)
        gap, ahead = apply(t) - b, None
        applied += 2
