"""Kerfs read from pictures of random coupons: errors, and errors over stated deviations.

python -m benchmarks.kerf [--pictures 200] [--seed 11] [--known]
"""

from __future__ import annotations

import argparse

from benchmarks.suites.coupons.measure import (
    GROUPS,
    CouponErrors,
    pool_errors,
    read_case,
    standard_coupon,
)
from cmpdesign.products.laser.coupon.picture import PhotoError


def main() -> None:
    parser = argparse.ArgumentParser(description="Kerfs read from pictures of random coupons.")
    parser.add_argument("--pictures", type=int, default=200, help="number of pictures")
    parser.add_argument("--seed", type=int, default=11, help="seed of coupons and views")
    parser.add_argument("--known", action="store_true", help="state the response to the reader")
    parser.add_argument("--each", action="store_true", help="print every picture, too")
    options = parser.parse_args()
    coupon = standard_coupon()
    errors: list[CouponErrors] = []
    refused: list[str] = []
    for number in range(options.pictures):
        try:
            errors.append(read_case(coupon, number, options.seed, options.known))
        except PhotoError as error:
            refused.append(f"picture {number}: {error}")
            continue
        if options.each:
            _print_case(errors[-1])
    _print_table(errors)
    print(f"\nseed {options.seed}; refused: {len(refused)}", *refused, sep="\n  ")


def _print_case(one: CouponErrors) -> None:
    case, pooled = one.case, pool_errors([one])
    response = case.view.response if isinstance(case.view.response, str) else f"{case.view.response:.2f}"
    jpeg = case.view.jpeg_quality or "-"
    print(
        f"{case.number:4d} {case.camera:8}{case.sheet:12}{case.dpi:5.0f} blur {case.view.blur_px:.1f} jpeg {jpeg!s:3}"
        f" {response:5} mean {pooled.mean_um:+7.2f} stated {pooled.stated_um:6.2f} z {pooled.z:.2f}  {one.response}",
        flush=True,
    )


def _print_table(errors: list[CouponErrors]) -> None:
    print(
        f"\n{'':20}{'pictures':>9}{'mean um':>9}{'RMS um':>8}{'worst picture':>15}{'stated um':>11}{'z':>6}{'> 3':>8}"
    )
    for name, belongs in GROUPS.items():
        chosen = [one for one in errors if belongs(one.case)]
        if chosen:
            figures = pool_errors(chosen)
            print(
                f"{name:20}{figures.pictures:9d}{figures.mean_um:+9.2f}{figures.rms_um:8.2f}{figures.worst_um:15.2f}"
                f"{figures.stated_um:11.2f}{figures.z:6.2f}{100 * figures.beyond:6.1f} %"
            )


if __name__ == "__main__":
    main()
