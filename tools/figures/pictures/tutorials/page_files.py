"""The files that stand on the tutorials' pages, what a camera sees of them, and mosaics of such pictures."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.coupons.photograph import CouponView, photograph_coupon
from cmpdesign.design.design import Design, load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.products.laser.coupon.design import Coupon
from cmpdesign.scene import Scene, load_scene, render

PAGES = Path(__file__).resolve().parents[4] / "docs" / "tutorials"
Picture = NDArray[np.uint8]
KERF_MM = (0.21, 0.19)  # of the coupon's scan, in x and y, at the narrower face of the openings
GAP_PX = 8
JPEG_QUALITY = 60


@cache
def page_file(page: str, name: str) -> str:
    """The text of the file that the block "toml NAME" of a page becomes."""
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    found = re.search(rf"^```toml {re.escape(name)}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    if found is None:
        raise ValueError(f"{page}.md: has no block of the file {name}")
    return found[1]


def page_design(page: str, name: str) -> Design:
    """The design of a page's file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(page_file(page, name), encoding="utf-8")
        return load_design(str(path))


def page_layout(page: str, name: str) -> Layout:
    """The layout of a page's design file."""
    return build_layout(page_design(page, name))


def page_picture(page: str, name: str, layout: Layout) -> Picture:
    """(H, W, 3) uint8 BGR: the last frame of a page's scene file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(page_file(page, name), encoding="utf-8")
        scene_file = load_scene(path, layout)
        *_, scene = scene_file.scenes()
    return scene_picture(scene, scene_file.size_px)


def scene_picture(scene: Scene, size_px: tuple[int, int]) -> Picture:
    """(H, W, 3) uint8 BGR."""
    return np.asarray(render(scene, size=size_px).image, np.uint8)


def coupon_scan(coupon: Coupon) -> Picture:
    """(H, W, 3) uint8 BGR: the scan of a coupon that a beam of known kerf has cut, which stands for a reader's own."""
    scan = photograph_coupon(coupon, {patch.name: KERF_MM for patch in coupon.patches}, CouponView())
    return np.asarray(scan, np.uint8)


def cropped(picture: Picture, area_px: tuple[int, int, int, int]) -> Picture:
    """The part from (left, top) to (right, bottom)."""
    left, top, right, bottom = area_px
    return picture[top:bottom, left:right]


def resized(picture: Picture, size_px: tuple[int, int]) -> Picture:
    """The picture with (width, height) px."""
    return np.asarray(cv2.resize(picture, size_px, interpolation=cv2.INTER_AREA), np.uint8)


def mosaic(rows: list[list[Picture]], tile_px: tuple[int, int]) -> Picture:
    """Rows of pictures, each reduced to a tile, with white between them."""
    beside = np.full((tile_px[1], GAP_PX, 3), 255, np.uint8)
    lines = [
        np.hstack([part for picture in row for part in (beside, resized(picture, tile_px))][1:])
        for row in rows
    ]
    below = np.full((GAP_PX, lines[0].shape[1], 3), 255, np.uint8)
    return np.vstack([part for line in lines for part in (below, line)][1:])


def to_jpeg(picture: Picture) -> bytes:
    """JPEG of a quality that suits photographs of some hundred pixels."""
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1])


def to_small_png(picture: Picture) -> bytes:
    """PNG with colors in steps of 32, which are hardly seen in a drawing and compress better."""
    stepped = np.where(picture > 240, 255, picture // 32 * 32 + 16).astype(np.uint8)
    return bytes(cv2.imencode(".png", stepped, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])
