"""Random cameras of 40 to 120 degrees, and where they see a sheet."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene import Pinhole
from cmpdesign.scene.camera.pinhole import project_3d
from cmpdesign.scene.errors import SceneError

Array = NDArray[np.float64]

SIZE_PX = (1280, 960)
MARGIN_PX = 8.0
PLACES = (
    (0.5, 0.5), (0.32, 0.34), (0.68, 0.34), (0.32, 0.66), (0.68, 0.66), (0.5, 0.45), (0.3, 0.5), (0.5, 0.55), (0.7, 0.5)
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class TrueCamera:
    """A camera without a pose.

    Attributes:
        field_deg: across the width.
        pinhole: with any pose.
    """

    field_deg: float
    pinhole: Pinhole


def random_camera(rng: np.random.Generator, least_deg: float = 40.0, most_deg: float = 120.0) -> TrueCamera:
    """A camera with mild distortion up to 75 degrees, and a lens between equidistant and perspective beyond."""
    width, height = SIZE_PX
    field_deg = float(rng.uniform(least_deg, most_deg))
    half = np.radians(field_deg / 2)
    centre = ((width - 1) / 2 + rng.normal(0, 8), (height - 1) / 2 + rng.normal(0, 8))
    if field_deg < 75:
        focal_px = width / 2 / np.tan(half)
        k1, k2 = rng.normal(-0.1, 0.08), rng.normal(0.03, 0.03)
        lens = (k1, k2, rng.normal(0, 5e-4), rng.normal(0, 5e-4), 0.0)
    else:
        # the field is cut off by the picture, so that the focal length follows from the lens
        focal_px = width / 2 / half
        lens = tuple(rng.normal(0, 1, 4) * (0.03, 0.01, 0.003, 0.001))
    kind = "perspective" if field_deg < 75 else "fisheye"
    focal = (focal_px, focal_px * float(1 + rng.normal(0, 3e-4)))
    lens = tuple(float(value) for value in lens)
    return TrueCamera(field_deg, Pinhole(focal, (float(centre[0]), float(centre[1])), lens, lens=kind))  # type: ignore[arg-type]


def place_sheet(camera: TrueCamera, number: int, rim_mm: Array, rng: np.random.Generator) -> Pinhole:
    """The camera with a pose in which it sees a sheet as large as fits at one of ``PLACES``, tilted.

    Args:
        rim_mm: (N, 3) points of the sheet that must be seen, around the origin.
    """
    size = np.array(SIZE_PX)
    target_px = np.array(PLACES[number % len(PLACES)]) * size + rng.uniform(-20, 20, 2)
    tilt, azimuth, roll = np.radians(rng.uniform(8, 40)), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    turn = cv2.Rodrigues(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))[0]
    spin = cv2.Rodrigues(np.array([0, 0, roll]))[0]
    rotation = np.asarray(turn @ spin @ np.diag([1.0, -1.0, -1.0]))
    ahead = _direction(camera.pinhole, target_px)
    distance_mm = 0.6 * float(np.hypot(*rim_mm.T[:2]).max())
    while True:
        distance_mm *= 1.05
        posed = _posed(camera.pinhole, rotation, distance_mm * ahead)
        try:
            xy_px = project_3d(posed, rim_mm)
        except SceneError:
            continue
        if (xy_px > MARGIN_PX).all() and (xy_px < size - 1 - MARGIN_PX).all():
            return _posed(camera.pinhole, rotation, distance_mm * float(rng.uniform(1.0, 1.15)) * ahead)


def _posed(pinhole: Pinhole, rotation: Array, shift_mm: Array) -> Pinhole:
    return Pinhole(
        pinhole.focal_px, pinhole.centre_px, pinhole.distortion, rotation, shift_mm, lens=pinhole.lens
    )


def _direction(pinhole: Pinhole, xy_px: Array) -> Array:
    """(3,) unit vector to a pixel, without the lens' distortion where it is mild."""
    offset = (xy_px - pinhole.centre_px) / pinhole.focal_px
    radius = float(np.hypot(*offset))
    angle = min(radius, 1.2) if pinhole.lens == "fisheye" else np.arctan(radius)
    across = offset / max(radius, 1e-9) * np.sin(angle)
    return np.array([*across, np.cos(angle)])
