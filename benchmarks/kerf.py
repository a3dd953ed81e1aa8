"""Kerfs read from pictures of random coupons: errors, and errors over stated deviations."""

from __future__ import annotations

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.suites.coupons.measure import CouponErrors, kerfs_table, read_case, standard_coupon
from cmpdesign.products.laser.coupon.picture import PhotoError


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
    yield kerfs_table(errors)
    yield "\n  ".join([f"seed {seed}; refused: {len(refused)}", *refused])


main = Experiment("kerf", measure)
main.run_as(__name__)
