"""The pictures of the tutorials, of the designs and scene files that stand on their pages."""

from __future__ import annotations

import cv2
import numpy as np

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.products.laser.coupon.design import design_coupon
from cmpdesign.products.laser.setup import complete_setup
from cmpdesign.products.sheet.print_sheet import make_print_sheet
from cmpdesign.scene import Camera, Optics, Scene, Sensor
from extractor import Extractor, parse_layout
from extractor.draw import draw_markers

from . import displacement
from .casting import casting
from .page_files import (
    coupon_scan,
    cropped,
    mosaic,
    page_design,
    page_layout,
    page_picture,
    resized,
    scene_picture,
    to_jpeg,
    to_small_png,
)

QUICK_PX = (640, 480)
VIEW_PX_MM = 16.7  # of the sensor tac3d
TWO_PX, THREE_PX = (236, 177), (168, 126)


def figures() -> dict[str, bytes]:
    """File name -> JPEG, PNG or SVG."""
    return {
        **_first_pattern("first-pattern"),
        **_laser_pad("laser-pad"),
        **_cast_pad("cast-pad"),
        **displacement.figures("sensor"),
        **_compare_designs("compare-designs"),
    }


def _first_pattern(page: str) -> dict[str, bytes]:
    layout = page_layout(page, "first.toml")
    photo = page_picture(page, "desk.toml", layout)
    reference = parse_layout(layout_to_json(layout))
    overlay = draw_markers(photo, reference, Extractor(reference).extract(photo))
    near = Scene(layout, Camera(90.0, rotation_deg=8.0), optics=Optics(1.0))
    blurred = Scene(layout, Camera(36.0), optics=Optics(9.0))
    failures = [
        [scene_picture(near, QUICK_PX), scene_picture(blurred, QUICK_PX)],
        [page_picture(page, "thumb.toml", layout), page_picture(page, "lamp.toml", layout)],
    ]
    numbered = cropped(overlay, (410, 180, 1190, 765))
    return {
        "tutorial-sheet.png": _sheet(page, "first.toml"),
        "tutorial-photo.jpg": to_jpeg(mosaic([[photo, numbered]], TWO_PX)),
        "tutorial-photo-failures.jpg": to_jpeg(mosaic(failures, TWO_PX)),
    }


def _sheet(page: str, name: str) -> bytes:
    """The page to print, PNG."""
    import resvg_py

    design = page_design(page, name)
    svg = make_print_sheet(design, build_layout(design)).files["print/sheet.svg"]
    png = resvg_py.svg_to_bytes(svg_string=str(svg), dpi=100, skip_system_fonts=True)
    raster = cv2.imdecode(np.frombuffer(bytes(png), np.uint8), cv2.IMREAD_COLOR)
    small = resized(np.asarray(raster, np.uint8), (240, 339))
    framed = cv2.copyMakeBorder(small, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(190, 190, 190))
    return to_small_png(np.asarray(framed, np.uint8))


def _laser_pad(page: str) -> dict[str, bytes]:
    layout = page_layout(page, "laser.toml")
    pads = [page_picture(page, f"{name}.toml", layout) for name in ("bench", "smear", "unfilled")]
    scan = coupon_scan(design_coupon(complete_setup(page_design(page, "laser.toml").laser)))
    return {
        "tutorial-coupon.jpg": to_jpeg(resized(scan, (331, 293))),
        "tutorial-laser-failures.jpg": to_jpeg(mosaic([pads], THREE_PX)),
    }


def _cast_pad(page: str) -> dict[str, bytes]:
    layout = page_layout(page, "cast.toml")
    pads = [page_picture(page, f"{name}.toml", layout) for name in ("rest", "bubbles", "cloudy")]
    return {
        "tutorial-casting.svg": casting().text_of().encode(),
        "tutorial-cast-failures.jpg": to_jpeg(mosaic([pads], THREE_PX)),
    }


def _compare_designs(page: str) -> dict[str, bytes]:
    parts = []
    for name in ("coarse", "middle", "finest"):
        layout = page_layout(page, f"{name}.toml")
        camera = Camera(VIEW_PX_MM * float(layout.parameters["pitch_mm"]), rotation_deg=9.0)
        scene = Scene(layout, camera, optics=Optics(1.2), sensor=Sensor(noise=2.0))
        small = cropped(scene_picture(scene, (320, 240)), (104, 78, 216, 162))
        parts.append(
            np.asarray(cv2.resize(small, None, fx=3, fy=3, interpolation=cv2.INTER_NEAREST), np.uint8)
        )
    return {"tutorial-candidates.jpg": to_jpeg(mosaic([parts], THREE_PX))}
