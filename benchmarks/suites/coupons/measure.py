"""Errors of the kerfs that are read from pictures of random coupons, and their pooled figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.pooled import Columns, Figure, joined, pooled_table, rms_of
from benchmarks.frame.table import Table
from benchmarks.suites.coupons.cases import CouponCase, random_case
from benchmarks.suites.coupons.photograph import photograph_coupon
from cmpdesign.design.design import load_design
from cmpdesign.products.laser.coupon.design import Coupon, design_coupon
from cmpdesign.products.laser.coupon.photo import read_coupon
from cmpdesign.products.laser.setup import complete_setup

FINE_DPI = 600.0
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CouponErrors:
    """The reading of one case: errors and stated deviations of all kerfs, mm."""

    case: CouponCase
    error_mm: Floats
    sigma_mm: Floats
    response: str


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


def _of_kerfs(figure: Callable[[Floats, Floats], Any]) -> Figure:
    """A figure of the errors and the stated deviations of all kerfs of several cases, um."""

    def pooled(errors: Sequence[CouponErrors]) -> float:
        return float(figure(1000 * joined(errors, "error_mm"), 1000 * joined(errors, "sigma_mm")))

    return pooled


COLUMNS: Columns = {
    "pictures": ("d", len),
    "mean um": ("+.2f", _of_kerfs(lambda error, _: error.mean())),
    "RMS um": (".2f", _of_kerfs(lambda error, _: rms_of(error))),
    "worst picture": (".2f", lambda errors: max(1000 * abs(one.error_mm.mean()) for one in errors)),
    "stated um": (".2f", _of_kerfs(lambda _, sigma: rms_of(sigma))),
    "z": (".2f", _of_kerfs(lambda error, sigma: rms_of(error / sigma))),
    "> 3": (".1%", _of_kerfs(lambda error, sigma: (np.abs(error / sigma) > 3).mean())),
}
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


def kerfs_table(errors: Sequence[CouponErrors]) -> Table:
    """A row for every group of pictures."""
    groups = {name: [one for one in errors if belongs(one.case)] for name, belongs in GROUPS.items()}
    return pooled_table("kerfs", "", COLUMNS, groups)
