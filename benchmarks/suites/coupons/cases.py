"""Random coupons and views: kerfs of 0.04 to 0.35 mm, scanners of 300 to 1200 dpi, phones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.suites.coupons.photograph import CouponView
from cmpdesign.products.laser.coupon.design import Coupon

MM_PER_INCH = 25.4
SMALLEST_KERF_MM, LARGEST_KERF_MM = 0.04, 0.35
DPI = (300, 400, 600, 800, 1200)
DPI_SHARES = (0.25, 0.15, 0.35, 0.1, 0.15)


@dataclass(frozen=True)
class CouponCase:
    """A coupon's kerfs by patch (x, y), its view, and the kind of camera and sheet."""

    number: int
    camera: str
    sheet: str
    dpi: float
    kerf_mm: dict[str, tuple[float, float]]
    view: CouponView


def random_case(coupon: Coupon, number: int, seed: int) -> CouponCase:
    """The case of a number; the same for the same seed."""
    rng = np.random.default_rng([seed, number])
    camera = "phone" if rng.random() < 0.4 else "scanner"
    sheet = str(rng.choice(["dark", "bright", "translucent"]))
    base = rng.uniform(SMALLEST_KERF_MM, LARGEST_KERF_MM)
    widths = np.clip(
        base * rng.uniform(0.8, 1.25, (len(coupon.patches), 2)), SMALLEST_KERF_MM, LARGEST_KERF_MM
    )
    kerf_mm = {patch.name: (float(x), float(y)) for patch, (x, y) in zip(coupon.patches, widths, strict=True)}
    dpi = float(rng.uniform(300, 900) if camera == "phone" else rng.choice(DPI, p=DPI_SHARES))
    phone = camera == "phone"
    levels = {"dark": ((15, 60), (170, 235)), "bright": ((170, 235), (15, 60))}
    sheet_range, ground_range = levels.get(sheet, ((80, 150), (190, 235)))
    view = CouponView(
        scale_px_mm=dpi / MM_PER_INCH,
        turn_deg=rng.uniform(0, 360),
        tilt=rng.uniform(-0.12, 0.12) if phone else rng.uniform(-0.001, 0.001),
        barrel=rng.uniform(-0.002, 0.002) if phone else 0.0,
        mirrored=bool(rng.random() < 0.3),
        blur_px=rng.uniform(0.6, 2.0),
        glow=rng.uniform(0.03, 0.12) if sheet == "translucent" else 0.0,
        glow_mm=rng.uniform(0.08, 0.2),
        sheet=rng.uniform(*sheet_range),
        ground=rng.uniform(*ground_range),
        uneven=rng.uniform(-0.15, 0.15) if phone else rng.uniform(-0.05, 0.05),
        vignette=rng.uniform(0, 0.12) if phone else 0.0,
        response="srgb" if rng.random() < 0.5 else float(rng.uniform(1.8, 2.6)),
        noise=rng.uniform(1.0, 4.0) if phone else rng.uniform(0.5, 3.0),
        jpeg_quality=int(rng.integers(80, 97)) if phone or rng.random() < 0.3 else None,
        seed=number,
    )
    return CouponCase(number, camera, sheet, dpi, kerf_mm, view)
