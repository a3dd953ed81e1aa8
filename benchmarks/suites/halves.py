"""Two views in the halves of one image, as behind mirrors: the cameras, and the reader's views of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cmpdesign.scene import Pinhole
from extractor import Rig, View
from extractor.space.medium import Medium

DISTORTION = (-0.08, 0.03, 0.0005, -0.0008, 0.0)


def two_cameras(
    size: tuple[int, int], rolls_deg: Sequence[float] = (0.0, 0.0), **options: Any
) -> tuple[Pinhole, ...]:
    """Cameras of the left and the right half of the image, behind the pattern, tilted to either side.

    ``options`` are those of ``Pinhole.looking``.
    """
    width, height = size[0] // 2, size[1]
    sides = (("left", 180.0, rolls_deg[0]), ("right", 0.0, rolls_deg[1]))
    return tuple(
        Pinhole.looking(
            size, azimuth_deg=azimuth, roll_deg=roll, back=True, area_px=(k * width, 0, width, height), name=name,
            **{"distortion": DISTORTION, **options},
        )
        for k, (name, azimuth, roll) in enumerate(sides)
    )  # fmt: skip


def placed_views(cameras: Sequence[Pinhole]) -> list[View]:
    """The views with their true poses."""
    return [
        View(c.name, c.focal_px, c.centre_px, c.distortion, c.area_px, None, c.R_camera_from_layout,
             c.t_camera_from_layout_mm)
        for c in cameras
    ]  # fmt: skip


def rig_of(cameras: Sequence[Pinhole], medium: Medium | None = None) -> Rig:
    """A rig with intrinsics and without poses."""
    return Rig(
        tuple(View(c.name, c.focal_px, c.centre_px, c.distortion, c.area_px, medium=medium) for c in cameras)
    )
