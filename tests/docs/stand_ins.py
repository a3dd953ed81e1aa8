"""Pictures that a person would take, made for the commands of the documentation that read them."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import cv2
import resvg_py
from PIL import Image

from cmpdesign.products.laser.coupon.design import load_coupon
from tools.figures.pictures.tutorials.page_files import coupon_scan

SCAN_DPI = 300


def make_stand_in(words: list[str]) -> None:
    """Draw the scan of a coupon before ``kerf``, and that of the print sheet before ``verify``, if there is none."""
    if words[:2] == ["cmpdesign", "kerf"] and not Path(words[3]).exists():
        assert cv2.imwrite(words[3], coupon_scan(load_coupon(words[2])))
    sheet = Path("out/print/sheet.svg")
    if words[:2] == ["cmpdesign", "verify"] and words[3] == "scan.png" and sheet.exists():
        svg = sheet.read_text(encoding="utf-8")
        png = bytes(resvg_py.svg_to_bytes(svg_string=svg, dpi=SCAN_DPI))
        Image.open(BytesIO(png)).save(words[3], dpi=(SCAN_DPI, SCAN_DPI))
