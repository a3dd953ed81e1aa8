"""Pictures of a sheet by one camera: bent paper, blur, noise, tone curve, JPEG; some that contradict the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.lenses.cameras import SIZE_PX, TrueCamera, place_sheet
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Optics, Pinhole, Plain, Scene, Sensor, render

Array = NDArray[np.float64]

BAD_KINDS = ("focus", "bent", "moved")
FOCUS_SHARE = 0.01  # change of the focal length
BAD_BEND_MM = 1.5
MOVED_PX = 3.0  # between the image's first and last row


@dataclass(frozen=True)
class Conditions:
    """How pictures are taken.

    Attributes:
        bend_mm: height of the sheet's cylindrical bend.
        bad: number -> kind of a picture that contradicts the others.
        jpeg_quality: None: PNG.
        response: the sensor's; the reader assumes sRGB unless told otherwise.
    """

    bend_mm: float = 0.0
    bad: tuple[tuple[int, str], ...] = ()
    jpeg_quality: int | None = 90
    response: Literal["srgb"] | float = "srgb"


def bent_sheet(height_mm: float, half_mm: float, angle: float) -> Callable[[Array], Array]:
    """The map of a flat sheet (N, 2) mm to a cylinder (N, 3) mm of this height within ``half_mm``, lengths kept."""
    radius = (half_mm**2 + height_mm**2) / (2 * height_mm)
    along = np.array([np.cos(angle), np.sin(angle)])

    def bend(xy_mm: Array) -> Array:
        s = xy_mm @ along
        moved = radius * np.sin(s / radius) - s
        return np.column_stack(
            [xy_mm + moved[:, None] * along, radius * (1 - np.cos(s / radius)) - height_mm / 2]
        )

    return bend


def take_pictures(
    camera: TrueCamera,
    layout: Layout,
    count: int,
    conditions: Conditions,
    rng: np.random.Generator,
    background: Plain | None = None,
) -> list[NDArray[Any]]:
    """``count`` pictures (H, W, 3) uint8 BGR of one sheet; without a background it lies on the pattern's black."""
    half_mm, angle = float(np.hypot(*layout.outline_mm.T).max()), float(rng.uniform(0, np.pi))
    bad = dict(conditions.bad)
    optics = Optics(float(rng.uniform(0.7, 1.4)))
    sensor = Sensor(float(rng.uniform(1, 3)), conditions.response, 8, conditions.jpeg_quality)
    pictures = []
    for number in range(count):
        kind = bad.get(number, "")
        height_mm = BAD_BEND_MM if kind == "bent" else conditions.bend_mm
        surface = bent_sheet(height_mm, half_mm, angle) if height_mm else None
        flat_mm = np.column_stack([layout.outline_mm, np.zeros(len(layout.outline_mm))])
        pose = place_sheet(camera, number, surface(layout.outline_mm) if surface else flat_mm, rng)
        if kind == "focus":
            fx, fy = pose.focal_px
            pose = replace(pose, focal_px=(fx * (1 + FOCUS_SHARE), fy * (1 + FOCUS_SHARE)))
        scene = Scene(layout, pose, surface, optics=optics, sensor=sensor, seed=int(rng.integers(1 << 30)))
        if background is not None:
            scene = replace(scene, background=background)
        image = render(scene, size=SIZE_PX).image
        pictures.append(_moved(image) if kind == "moved" else image)
    return pictures


def _moved(image: NDArray[Any]) -> NDArray[Any]:
    """The picture of a sheet that moves to the right, ever faster, while the rows are read."""
    height, width = image.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    return np.asarray(cv2.remap(image, x - np.float32(MOVED_PX) * (y / height) ** 2, y, cv2.INTER_LINEAR))


def to_view(pinhole: Pinhole) -> Any:
    """The camera as the reader's view, without a pose."""
    from extractor import View

    return View("truth", pinhole.focal_px, pinhole.centre_px, pinhole.distortion, lens=pinhole.lens)
