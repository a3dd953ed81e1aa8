"""The kerfs of all patches from the widths of their openings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmpdesign.products.laser.coupon.design import Coupon
from cmpdesign.products.laser.coupon.openings import BANDS, OpeningProfile
from cmpdesign.products.laser.coupon.picture import Values

# Deviation of the map's scale over the coupon in units of the fiducials' misfit over the coupon's size, and its least.
SCALE_FACTOR, MIN_SCALE = 3.0, 2e-4
# Deviation of a slot's excess light, which is taken from the square of its patch, as a share.
EXCESS_DEVIATION = 0.003


@dataclass(frozen=True, eq=False)
class KerfFit:
    """The kerfs of one direction; (P,) by patch, mm, with their standard deviations."""

    value_mm: Values
    sigma_mm: Values


def scale_deviation(coupon: Coupon, fit_mm: float) -> float:
    """The relative deviation of lengths by the map, from the misfit of the fiducials."""
    size = float(np.ptp(np.array(coupon.fiducials_mm), axis=0).max())
    return float(np.hypot(SCALE_FACTOR * fit_mm / size, MIN_SCALE))


def fit_kerfs(profiles: Sequence[OpeningProfile], along_x: bool, deviation: float) -> KerfFit:
    """Fit a kerf for each patch and a scale that varies linearly over the coupon.

    Args:
        profiles: of all openings.
        along_x: the direction.
        deviation: relative deviation of lengths by the map.
    """
    chosen = [one for one in profiles if one.across.along_x == along_x]
    patches = np.array([one.across.patch for one in chosen])
    nominal = np.array([one.across.width_mm for one in chosen])
    place = np.array([(one.across.opening.x_mm, one.across.opening.y_mm) for one in chosen])
    place = (place - place.mean(axis=0)) / np.ptp(place, axis=0).max() * 2
    excess = np.array([one.widths_mm.mean() for one in chosen]) - nominal
    sigma = np.array([_width_deviation_mm(one) for one in chosen])
    kerf = (patches[:, None] == np.arange(patches.max() + 1)).astype(np.float64)
    scale = nominal[:, None] * np.column_stack([np.ones(len(chosen)), place])
    design = np.hstack([kerf, scale]) / sigma[:, None]
    prior = np.hstack([np.zeros((3, kerf.shape[1])), np.eye(3) / deviation])
    system = np.concatenate([design, prior])
    values = np.concatenate([excess / sigma, np.zeros(3)])
    covariance = np.linalg.inv(system.T @ system)
    solution = covariance @ (system.T @ values)
    misfit = float(((system @ solution - values) ** 2).sum())
    freedom = len(values) - len(solution)
    factor = max(misfit / max(freedom, 1), 1.0)
    count = kerf.shape[1]
    return KerfFit(solution[:count], np.sqrt(factor * np.diag(covariance)[:count]))


def _width_deviation_mm(one: OpeningProfile) -> float:
    """The deviation of a profile's mean width: the scatter of its bands, and a slot's excess."""
    scatter = float(one.widths_mm.std(ddof=1)) / np.sqrt(BANDS)
    lent = 0.0 if one.across.wide else EXCESS_DEVIATION * float(one.widths_mm.mean())
    return float(np.hypot(scatter, lent))
