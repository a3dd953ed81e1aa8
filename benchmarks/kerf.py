"""Kerfs read from pictures of random coupons: errors, and errors over stated deviations."""

from __future__ import annotations

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.coupons.measure import (
    GROUPS,
    CouponErrors,
    pool_errors,
    read_case,
    standard_coupon,
)
from cmpdesign.products.laser.coupon.picture import PhotoError

COLUMNS = {
    "": TEXT, "pictures": "d", "mean um": "+.2f", "RMS um": ".2f", "worst picture": ".2f", "stated um": ".2f",
    "z": ".2f", "> 3": ".1%",
}  # fmt: skip


def measure(pictures: int = 200, seed: int = 11) -> Shown:
    """One row for every group of pictures, and the refused ones.

    Args:
        seed: of coupons and views.
    """
    coupon = standard_coupon()
    errors: list[CouponErrors] = []
    refused: list[str] = []
    for number in range(pictures):
        try:
            errors.append(read_case(coupon, number, seed))
        except PhotoError as error:
            refused.append(f"picture {number}: {error}")
    of_groups = {name: [one for one in errors if belongs(one.case)] for name, belongs in GROUPS.items()}
    rows = [(name, *pool_errors(chosen)) for name, chosen in of_groups.items() if chosen]
    yield Table("kerfs", COLUMNS, rows)
    yield "\n  ".join([f"seed {seed}; refused: {len(refused)}", *refused])


main = Experiment("kerf", measure)

if __name__ == "__main__":
    raise SystemExit(main())
