"""Errors of the kerfs that are read from pictures of random coupons, and their pooled figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.coupons.cases import CouponCase, random_case
from benchmarks.suites.coupons.photograph import photograph_coupon
from cmpdesign.design.design import load_design
from cmpdesign.products.laser.coupon.design import Coupon, design_coupon
from cmpdesign.products.laser.coupon.photo import read_coupon
from cmpdesign.products.laser.setup import complete_setup

FINE_DPI = 600.0


@dataclass(frozen=True, eq=False)
class CouponErrors:
    """The reading of one case: errors and stated deviations of all kerfs, mm."""

    case: CouponCase
    error_mm: NDArray[np.float64]
    sigma_mm: NDArray[np.float64]
    response: str


class PooledErrors(NamedTuple):
    """Figures of several cases.

    Attributes:
        pictures: number of cases.
        mean_um, rms_um: mean and RMS error of all kerfs.
        worst_um: the largest mean error of one picture.
        stated_um: RMS of the stated deviations.
        z: RMS of error over stated deviation.
        beyond: share of kerfs beyond three stated deviations.
    """

    pictures: int
    mean_um: float
    rms_um: float
    worst_um: float
    stated_um: float
    z: float
    beyond: float


def standard_coupon() -> Coupon:
    """The coupon of the honeycomb template."""
    return design_coupon(complete_setup(load_design("honeycomb").laser))


def read_case(coupon: Coupon, number: int, seed: int) -> CouponErrors:
    """Read a random case."""
    case = random_case(coupon, number, seed)
    image = photograph_coupon(coupon, case.kerf_mm, case.view)
    reading = read_coupon(coupon, image)
    widths = [width for one in reading.patches for width in (one.x, one.y)]
    true = np.array([case.kerf_mm[one.patch.name] for one in reading.patches]).ravel()
    return CouponErrors(
        case,
        np.array([width.value_mm for width in widths]) - true,
        np.array([width.sigma_mm for width in widths]),
        reading.response,
    )


def pool_errors(errors: Sequence[CouponErrors]) -> PooledErrors:
    """Pool the errors of all kerfs of several cases."""
    error = 1000 * np.concatenate([one.error_mm for one in errors])
    sigma = 1000 * np.concatenate([one.sigma_mm for one in errors])
    z = error / sigma
    return PooledErrors(
        pictures=len(errors),
        mean_um=float(error.mean()),
        rms_um=float(np.sqrt((error**2).mean())),
        worst_um=max(1000 * abs(float(one.error_mm.mean())) for one in errors),
        stated_um=float(np.sqrt((sigma**2).mean())),
        z=float(np.sqrt((z**2).mean())),
        beyond=float((np.abs(z) > 3).mean()),
    )


GROUPS: dict[str, Callable[[CouponCase], bool]] = {
    "all": lambda case: True,
    "600 dpi and more": lambda case: case.dpi >= FINE_DPI,
    "below 600 dpi": lambda case: case.dpi < FINE_DPI,
    "scanner": lambda case: case.camera == "scanner",
    "phone": lambda case: case.camera == "phone",
    "dark sheet": lambda case: case.sheet == "dark",
    "bright sheet": lambda case: case.sheet == "bright",
    "translucent sheet": lambda case: case.sheet == "translucent",
    "sRGB": lambda case: case.view.response == "srgb",
    "exponent": lambda case: case.view.response != "srgb",
    "JPEG": lambda case: case.view.jpeg_quality is not None,
}
