"""Admissible tractions: no adhesion, shear up to the friction limit; and the directions in which they are free.

All tractions t here are float64 MPa of shape (3, rows, columns), or (1, rows, columns) without friction. z is the last
component.
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
    """Tractions in the admissible set, and the directions in which they are free.

    Attributes:
        projected_mpa: the tractions. Slipping cells are at the friction limit, cells without pressure are 0.
        free_mask: 1 where a component may change both ways, else 0, shaped as the tractions.
        slip_tangent: (2, rows, columns) unit vectors tangential to the limit's circle in slipping cells, 0 in other
            cells; None without friction.
        limit_mpa: the friction limit, (rows, columns).
    """

    projected_mpa: Array
    free_mask: Single
    slip_tangent: Single | None
    limit_mpa: Array

    def project_on_free_directions(self, values: Single) -> Single:
        """The projection of values, shaped as the tractions, on the free directions."""
        projected = values * self.free_mask
        if self.slip_tangent is not None:
            projected[:2] += self.slip_tangent * np.einsum("iyx,iyx->yx", self.slip_tangent, values[:2])
        return projected

    def turning_resistance(self, gap_mm: Array) -> Single:
        """Resistance of slipping friction to rotation, (rows, columns) mm/MPa: the slid distance over the limit."""
        if self.slip_tangent is None:
            return np.zeros(self.limit_mpa.shape, dtype=np.float32)
        slid_mm = self.slip_tangent[0] * gap_mm[1] - self.slip_tangent[1] * gap_mm[0]
        is_slipping = self.slip_tangent.any(axis=0)
        resistance = np.where(is_slipping, np.maximum(slid_mm, 0.0), 0.0) / np.where(
            is_slipping, self.limit_mpa, 1.0
        )
        return np.asarray(resistance, dtype=np.float32)


class AdmissibleTractions(Protocol):
    """The set of admissible tractions."""

    @property
    def limit_mpa(self) -> Array:
        """(rows, columns) the largest shear in every cell."""

    def project(self, t: Array) -> Array:
        """The nearest admissible tractions."""

    def free_components(self, t: Array) -> Mask:
        """The components that may change both ways, shaped as t."""

    def active_set(self, t: Array, predicted: Array) -> ActiveSet:
        """The active set of t, estimated from tractions that the gap has shifted to ``predicted``."""

    def with_updated_limit(self, t: Array) -> Self:
        """The set with the limits of these tractions."""

    def limit_change(self, t: Array) -> float:
        """The change of the limits by ``with_updated_limit``, as a share of the limits."""


@dataclass(frozen=True)
class CoulombTractions:
    """Tractions (3, rows, columns): pressure in ``contact_candidates``, shear up to ``limit_mpa``.

    Attributes:
        contact_candidates: (rows, columns) cells that the object can touch.
        coefficient: Coulomb's friction coefficient; may be infinite.
        limit_mpa: (rows, columns) the friction limit.
    """

    contact_candidates: Mask
    coefficient: float
    limit_mpa: Array

    @classmethod
    def at(cls, contact_candidates: Mask, coefficient: float, traction_z_mpa: Array) -> Self:
        """The set with the limit of these pressures; an infinite coefficient has no limit where there is pressure."""
        pressed = traction_z_mpa < 0
        if np.isinf(coefficient):
            return cls(contact_candidates, coefficient, np.where(pressed, np.inf, 0.0))
        return cls(contact_candidates, coefficient, np.where(pressed, -coefficient * traction_z_mpa, 0.0))

    def project(self, t: Array) -> Array:
        """The nearest admissible tractions."""
        projected = np.empty_like(t)
        projected[2] = np.where(self.contact_candidates, np.minimum(t[2], 0.0), 0.0)
        shear = _shear_magnitude(t)
        exceeds = shear > self.limit_mpa
        scale = np.where(exceeds, self.limit_mpa, 1.0) / np.where(exceeds, shear, 1.0)
        projected[:2] = t[:2] * scale
        return projected

    def free_components(self, t: Array) -> Mask:
        """Shear in sticking cells, z in cells with pressure."""
        sticks = _shear_magnitude(t) < self.limit_mpa * (1 - 1e-12)
        return np.stack([sticks, sticks, t[2] < 0])

    def active_set(self, t: Array, predicted: Array) -> ActiveSet:
        """Cells with predicted shear beyond the limit slip; cells with predicted tension separate."""
        shear = _shear_magnitude(predicted)
        sticks = shear < self.limit_mpa
        slips = ~sticks & (self.limit_mpa > 0)
        unit = np.where(slips, predicted[:2], 0.0) / np.where(slips, shear, 1.0)
        presses = self.contact_candidates & (predicted[2] < 0)
        projected = self.project(np.where(np.stack([sticks, sticks, presses]), t, 0.0))
        projected[:2] += np.where(slips, self.limit_mpa, 0.0) * unit
        free_mask = np.stack([sticks, sticks, presses]).astype(np.float32)
        tangent = np.stack([-unit[1], unit[0]]).astype(np.float32)
        return ActiveSet(projected, free_mask, tangent, self.limit_mpa)

    def with_updated_limit(self, t: Array) -> Self:
        """The set with the limit of these tractions' pressure."""
        return self.at(self.contact_candidates, self.coefficient, t[2])

    def limit_change(self, t: Array) -> float:
        """Sum of the limit's changes over its sum; with an infinite coefficient the share of changed cells."""
        new, old = self.with_updated_limit(t).limit_mpa, self.limit_mpa
        if np.isinf(self.coefficient):
            return float(np.count_nonzero(new != old) / max(int(np.count_nonzero(old)), 1))
        return float(np.abs(new - old).sum() / max(float(old.sum()), 1e-300))


@dataclass(frozen=True)
class PressureTractions:
    """Pressure alone: tractions (1, rows, columns), in ``contact_candidates`` (1, rows, columns)."""

    contact_candidates: Mask

    @property
    def limit_mpa(self) -> Array:
        """Zero: there is no shear."""
        return np.zeros(self.contact_candidates.shape)

    def project(self, t: Array) -> Array:
        """The nearest admissible tractions."""
        return np.where(self.contact_candidates, np.minimum(t, 0.0), 0.0)

    def free_components(self, t: Array) -> Mask:
        """Cells with pressure."""
        return np.asarray(t < 0)

    def active_set(self, t: Array, predicted: Array) -> ActiveSet:
        """Cells with predicted tension separate."""
        presses = self.contact_candidates & (predicted < 0)
        return ActiveSet(
            self.project(np.where(presses, t, 0.0)), presses.astype(np.float32), None, self.limit_mpa
        )

    def with_updated_limit(self, t: Array) -> Self:
        """The same set: its limit does not depend on the tractions."""
        return self

    def limit_change(self, t: Array) -> float:
        """Zero: the limit is constant."""
        return 0.0


def _shear_magnitude(t: Array) -> Array:
    """(rows, columns) magnitude of the shear; several times as fast as ``np.hypot``."""
    return np.asarray(np.sqrt(t[0] ** 2 + t[1] ** 2))
