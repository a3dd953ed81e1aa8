"""What tractions are allowed: no adhesion, no more shear than friction gives; and in which directions they may move.

All tractions here are (3, rows, columns), or (1, rows, columns) where there is no friction: z is the last.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class ActiveSet:
    """A place in the allowed set, and the directions in which tractions may move from there.

    Attributes:
        base_mpa: the place; what does not stick is on its limit, what does not press is 0.
        moves: 1 where a component may move both ways, else 0, shaped as the tractions.
        along: unit direction (2, rows, columns) across the friction of what slips, 0 where it does not; or None.
        limit_mpa: the friction's limit, (rows, columns).
    """

    projected_mpa: Array
    free_mask: Single
    along: Single | None
    limit_mpa: Array

    def project_on_free_directions(self, values: Single) -> Single:
        """The part of some values along the directions."""
        found = values * self.free_mask
        if self.along is not None:
            found[:2] += self.along * np.einsum("iyx,iyx->yx", self.along, values[:2])
        return found

    def turning_resistance(self, gap_mm: Array) -> Single:
        """Resistance (rows, columns) in mm/MPa to turning the friction that slips: the way slid over its limit."""
        if self.along is None:
            return np.zeros(self.limit_mpa.shape, dtype=np.float32)
        slid = self.along[0] * gap_mm[1] - self.along[1] * gap_mm[0]
        slips = self.along.any(axis=0)
        found = np.where(slips, np.maximum(slid, 0.0), 0.0) / np.where(slips, self.limit_mpa, 1.0)
        return np.asarray(found, dtype=np.float32)


class AdmissibleTractions(Protocol):
    """The set of tractions to choose from."""

    @property
    def limit_mpa(self) -> Array:
        """The most shear in every cell."""

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""

    def free(self, t: Array) -> Mask:
        """Components that may move both ways."""

    def face(self, t: Array, pulled: Array) -> ActiveSet:
        """Where t belongs if its gap pulls it to ``pull_box_mm``."""

    def with_updated_limit(self, t: Array) -> Self:
        """The set with its limits taken from these tractions."""

    def change(self, t: Array) -> float:
        """How far that would move the limits, as a share of them."""


@dataclass(frozen=True)
class CoulombTractions:
    """Tractions (3, rows, columns): pressure where ``contact_candidates``, shear up to ``limit_mpa``."""

    contact_candidates: Mask
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
        found[2] = np.where(self.contact_candidates, np.minimum(t[2], 0.0), 0.0)
        size = _shear_magnitude(t)
        over = size > self.limit_mpa
        shrink = np.where(over, self.limit_mpa, 1.0) / np.where(over, size, 1.0)
        found[:2] = t[:2] * shrink
        return found

    def free(self, t: Array) -> Mask:
        """Where it sticks, and where it presses."""
        sticks = _shear_magnitude(t) < self.limit_mpa * (1 - 1e-12)
        return np.stack([sticks, sticks, t[2] < 0])

    def face(self, t: Array, pulled: Array) -> ActiveSet:
        """What is pulled beyond its limit slips there; what is pulled off the object lets go."""
        size = _shear_magnitude(pulled)
        sticks = size < self.limit_mpa
        slips = ~sticks & (self.limit_mpa > 0)
        unit = np.where(slips, pulled[:2], 0.0) / np.where(slips, size, 1.0)
        presses = self.contact_candidates & (pulled[2] < 0)
        base = self.project(np.where(np.stack([sticks, sticks, presses]), t, 0.0))
        base[:2] += np.where(slips, self.limit_mpa, 0.0) * unit
        moves = np.stack([sticks, sticks, presses]).astype(np.float32)
        along = np.stack([-unit[1], unit[0]]).astype(np.float32)
        return ActiveSet(base, moves, along, self.limit_mpa)

    def with_updated_limit(self, t: Array) -> Self:
        """With the limit of these tractions' pressure."""
        return self.at(self.contact_candidates, self.coefficient, t[2])

    def change(self, t: Array) -> float:
        """Sum of the limit's changes over its sum; of cells, where there is no limit."""
        new, old = self.with_updated_limit(t).limit_mpa, self.limit_mpa
        if np.isinf(self.coefficient):
            return float(np.count_nonzero(new != old) / max(int(np.count_nonzero(old)), 1))
        return float(np.abs(new - old).sum() / max(float(old.sum()), 1e-300))


@dataclass(frozen=True)
class PressureTractions:
    """Pressure alone: tractions (1, rows, columns)."""

    contact_candidates: Mask

    @property
    def limit_mpa(self) -> Array:
        """No shear."""
        return np.zeros(self.contact_candidates.shape)

    def project(self, t: Array) -> Array:
        """The nearest allowed tractions."""
        return np.where(self.contact_candidates, np.minimum(t, 0.0), 0.0)

    def free(self, t: Array) -> Mask:
        """Where it presses."""
        return np.asarray(t < 0)

    def face(self, t: Array, pulled: Array) -> ActiveSet:
        """What is pulled off the object lets go."""
        presses = self.contact_candidates & (pulled < 0)
        return ActiveSet(
            self.project(np.where(presses, t, 0.0)), presses.astype(np.float32), None, self.limit_mpa
        )

    def with_updated_limit(self, t: Array) -> Self:
        """Itself: nothing here depends on the tractions."""
        return self

    def change(self, t: Array) -> float:
        """None."""
        return 0.0


def _shear_magnitude(t: Array) -> Array:
    """Of the shear; several times as fast as ``np.hypot``."""
    return np.asarray(np.sqrt(t[0] ** 2 + t[1] ** 2))
