"""Pictures that a person would take, made for the commands of the documentation that read them."""

from __future__ import annotations

from pathlib import Path

import cv2

from cmpdesign.products.laser.coupon.design import load_coupon
from docs.figures.pictures.tutorials.page_files import coupon_scan


def make_stand_in(words: list[str]) -> None:
    """Before ``cmpdesign kerf COUPON PICTURE``: draw the scan of that coupon, if there is none."""
    if words[:2] == ["cmpdesign", "kerf"] and not Path(words[3]).exists():
        assert cv2.imwrite(words[3], coupon_scan(load_coupon(words[2])))
