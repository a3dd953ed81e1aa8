"""Photos of a coupon: which of the coupons of a laser job a picture shows, and what is read from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from cmpdesign.api.designs import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import read_image
from cmpdesign.products.laser.coupon.design import Coupon, design_coupon
from cmpdesign.products.laser.coupon.picture import PhotoError
from cmpdesign.products.laser.grid.design import design_grid
from cmpdesign.products.laser.grid.reading import read_cut
from cmpdesign.products.laser.setup import complete_setup


def coupons_of(design: Design) -> list[Coupon]:
    """The coupon and the grid of the design's laser job; none where the job cannot be."""
    try:
        setup = complete_setup(design.laser)
    except CmpDesignError:
        return []
    return [design_coupon(setup), design_grid(setup)]


def coupon_readings(
    coupons: Sequence[Coupon], file: Path, most_pixels: int
) -> Iterator[tuple[Coupon, Any, tuple[int, int]]]:
    """The coupons that a picture shows, with what was read."""
    image = read_image(file, most_pixels, gray=True)
    for coupon in coupons:
        try:
            found = read_cut(coupon, file, image)
        except PhotoError:
            continue
        yield coupon, found, (image.shape[1], image.shape[0])
