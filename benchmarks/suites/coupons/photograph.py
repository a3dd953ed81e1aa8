"""A picture of a coupon: exact coverage, blurred in linear light, lit unevenly, encoded, with noise and JPEG."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from cmpdesign.products.laser.coupon.design import Coupon, Patch
from cmpdesign.scene.drawing.coverage import draw_coverage
from cmpdesign.scene.drawing.paths import PolygonSegments
from cmpdesign.scene.parts.optics import make_point_spread
from extractor.image.response import decode_values, encode_light, light_of_values

Points = NDArray[np.float64]
# The fiducials are cut without compensation, with a kerf of this width.
FIDUCIAL_KERF_MM = 0.16
MARGIN_MM = 5.0
LARGEST_BLUR_PX = 20.0


@dataclass(frozen=True)
class CouponView:
    """The view of a coupon.

    Attributes:
        scale_px_mm: pixels per mm.
        turn_deg: turn of the coupon in the picture.
        tilt: relative difference of the distance from the top of the coupon to its bottom.
        barrel: radial displacement by the lens at the coupon's corner, relative to its distance from the centre.
        mirrored: the coupon's back is seen.
        blur_px: sigma of the blur, in linear light.
        glow, glow_mm: share of the light that is spread far, and the sigma of its spread.
        sheet, ground: values (0 to 255) of the sheet and of the ground behind it, in the picture's middle.
        uneven, vignette: relative fall of the light from one side to the other, and from the centre to the corners.
        response: "srgb", "linear" or an exponent (light is value ** exponent).
        noise: sigma of the noise of the values.
        jpeg_quality: None without compression.
        bits: 8 or 16.
        seed: of the noise.
    """

    scale_px_mm: float = 23.6
    turn_deg: float = 4.0
    tilt: float = 0.02
    barrel: float = 0.0
    mirrored: bool = False
    blur_px: float = 1.2
    glow: float = 0.0
    glow_mm: float = 0.15
    sheet: float = 40.0
    ground: float = 200.0
    uneven: float = 0.08
    vignette: float = 0.0
    response: Literal["srgb", "linear"] | float = "srgb"
    noise: float = 2.0
    jpeg_quality: int | None = None
    bits: int = 8
    seed: int = 3


def photograph_coupon(
    coupon: Coupon, kerf_mm: Mapping[str, tuple[float, float]], view: CouponView
) -> NDArray[Any]:
    """The picture (H, W, 3) uint8 or uint16 of a coupon cut with known kerfs; ``kerf_mm``: patch name -> x, y."""
    outlines = [line for patch in coupon.patches for line in opening_outlines_mm(patch, kerf_mm[patch.name])]
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    circle = (coupon.fiducial_diameter_mm + FIDUCIAL_KERF_MM) / 2
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    outlines += [place + circle * unit for place in np.array(coupon.fiducials_mm)]
    frame = _PictureFrame(coupon, view)
    projected = [frame.to_image(outline) for outline in outlines]
    segments = [np.hstack([points, np.roll(points, -1, axis=0)]) for points in projected]
    owner = [np.full(len(points), number) for number, points in enumerate(segments)]
    paths = PolygonSegments(np.concatenate(segments), np.concatenate(owner))
    light_of_value = light_of_values(view.response)
    sheet, ground = decode_values(np.array([view.sheet, view.ground]), light_of_value)
    light = sheet + (ground - sheet) * _covered(paths, len(outlines), frame.size, view)
    values = encode_light(light * frame.illumination(), light_of_value)
    return _expose(values, view)


def opening_outlines_mm(patch: Patch, kerf_mm: tuple[float, float]) -> list[Points]:
    """The outlines of a patch's openings after cutting with an elliptic beam, in the coupon's frame."""
    half = np.array(kerf_mm) / 2
    outlines = []
    for o in patch.openings:
        size = np.array([o.width_mm, o.height_mm]) / 2 / half
        swept = shapely.buffer(shapely.box(*-size, *size), 1.0, quad_segs=64)
        outlines.append(shapely.get_coordinates(swept)[:-1] * half + (o.x_mm, o.y_mm))
    return outlines


class _PictureFrame:
    """The map from coupon to picture, and the picture's size and light."""

    def __init__(self, coupon: Coupon, view: CouponView) -> None:
        marks = np.array(coupon.fiducials_mm)
        low, high = marks.min(axis=0) - MARGIN_MM, marks.max(axis=0) + MARGIN_MM
        self._centre, self._span, self._view = (low + high) / 2, high - low, view
        turn = math.radians(view.turn_deg)
        self._rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        self._middle = np.zeros(2)
        corners = self.to_image(np.array([low, (high[0], low[1]), high, (low[0], high[1])]))
        width, height = np.ceil(np.ptp(corners, axis=0)).astype(int)
        self._middle = -corners.min(axis=0)
        self.size = (int(width), int(height))

    def to_image(self, xy_mm: Points) -> Points:
        view = self._view
        flip = np.array([-1.0 if view.mirrored else 1.0, 1.0])
        centred = ((xy_mm - self._centre) * flip) @ self._rotation.T
        centred = centred / (1 + view.tilt * centred[:, 1:] / self._span[1])
        radius = np.linalg.norm(centred, axis=1, keepdims=True) / (np.linalg.norm(self._span) / 2)
        bent = centred * (1 + view.barrel * radius**2)
        return bent * (view.scale_px_mm, -view.scale_px_mm) + self._middle

    def illumination(self) -> Points:
        """(H, W) relative light, 1 in the picture's middle."""
        x, y = (np.linspace(-1, 1, count) for count in self.size)
        view = self._view
        radius_2 = (x[None, :] ** 2 + y[:, None] ** 2) / 2
        return np.asarray((1 + view.uneven / 2 * x[None, :]) * (1 - view.vignette * radius_2))


def _covered(paths: PolygonSegments, count: int, size: tuple[int, int], view: CouponView) -> Points:
    """(H, W) the share of the openings in the light of every pixel."""
    ones = np.ones((count, 1))
    sharp = draw_coverage(paths, ones, size, make_point_spread(round(view.blur_px, 3)))[0]
    if not view.glow:
        return np.asarray(sharp, dtype=np.float64)
    wide_px = round(min(math.hypot(view.blur_px, view.glow_mm * view.scale_px_mm), LARGEST_BLUR_PX), 3)
    wide = draw_coverage(paths, ones, size, make_point_spread(wide_px))[0]
    return np.asarray((1 - view.glow) * sharp + view.glow * wide, dtype=np.float64)


def _expose(values: Points, view: CouponView) -> NDArray[Any]:
    noisy = values
    if view.noise:
        noisy = values + np.random.default_rng(view.seed).normal(0, view.noise, values.shape)
    if view.bits == 16:
        return np.repeat(np.clip(np.rint(257 * noisy), 0, 65535).astype(np.uint16)[..., None], 3, axis=2)
    image = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    if view.jpeg_quality is None:
        return image
    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, view.jpeg_quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
