"""The result of one frame: force, torque, regions, tractions, each with its covariance, or a reason."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ContactReason(IntEnum):
    """Why a frame has no force, or why its force is to be doubted."""

    NONE = 0
    NOTHING_TOUCHED = 1
    TOO_FEW_MARKERS = 2
    TOO_LITTLE_FORCE = 3
    BEYOND_STRAIN = 4
    AT_RIM = 5

    @property
    def text(self) -> str:
        """One sentence."""
        return _TEXTS[self]


_TEXTS = {
    ContactReason.NONE: "",
    ContactReason.NOTHING_TOUCHED: "nothing touches the layer",
    ContactReason.TOO_FEW_MARKERS: "too many markers have no displacement",
    ContactReason.TOO_LITTLE_FORCE: "the force is not above three of its deviations",
    ContactReason.BEYOND_STRAIN: "the mean pressure is beyond the model's range",
    ContactReason.AT_RIM: "the contact reaches the rim of the gel",
}


@dataclass(frozen=True, eq=False)
class Region:
    """One contact, in the layout frame.

    Attributes:
        area_mm2, area_sigma_mm2: touched area, and its deviation. Too large where a part is narrower than two loads.
        outline_mm: (P, 2) float64, the closed outline of this area, counter-clockwise.
        centre_mm: (2,) centre of pressure.
        centre_cov_mm2: (2, 2).
        force_n, force_cov_n2: (3,) and (3, 3), as of the frame.
        torque_nmm, torque_cov_nmm2: (3,) and (3, 3), about the frame's point.
    """

    area_mm2: float
    area_sigma_mm2: float
    outline_mm: Array = field(repr=False)
    centre_mm: Array
    centre_cov_mm2: Array = field(repr=False)
    force_n: Array
    force_cov_n2: Array = field(repr=False)
    torque_nmm: Array
    torque_cov_nmm2: Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class ContactForce:
    """The contact in one frame. The force is that of the object on the layer, in the layout frame: a press has z < 0.

    Attributes:
        reason: ``NONE`` where there is an answer without a doubt. With ``AT_RIM``, ``BEYOND_STRAIN`` and
            ``TOO_LITTLE_FORCE`` the fields are given; with the other reasons force and torque are NaN, or 0 where
            nothing touches.
        force_n, force_cov_n2: (3,) N and (3, 3) N^2. The covariance has the noise, the model's own error and the
            deviations of the modulus.
        torque_nmm, torque_cov_nmm2: (3,) N mm about ``about_mm``, and (3, 3).
        about_mm: (3,) the point of the torque.
        regions: the contacts, the largest force first.
        loads_mm: (K, 2) places of ``traction_mpa`` on the touched face.
        traction_mpa: (K, 3) float64; z is minus the pressure.
        marker_traction_mpa: (M, 3) the same above the markers.
        utilisation: \\|F_t\\| / (mu \\|F_z\\|); NaN without a coefficient of friction.
        misfit: root mean square of the displacements' residual, in deviations; above 1 the model does not explain them.
    """

    reason: ContactReason
    force_n: Array
    force_cov_n2: Array = field(repr=False)
    torque_nmm: Array
    torque_cov_nmm2: Array = field(repr=False)
    about_mm: Array = field(repr=False)
    regions: tuple[Region, ...] = field(repr=False)
    loads_mm: Array = field(repr=False)
    traction_mpa: Array = field(repr=False)
    marker_traction_mpa: Array = field(repr=False)
    utilisation: float
    misfit: float
