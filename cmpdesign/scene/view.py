"""The way from the layout to the image: the scene's surface seen by one of its cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.camera import Camera, homography, is_mirrored, pinhole, pitch_mm, project
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.pinhole import Area, Pinhole, project_3d
from cmpdesign.scene.scene import Scene
from cmpdesign.scene.surface import determinant, points_to_check, require_no_fold

Points = NDArray[np.float64]
Map = Callable[[Points], Points]


@dataclass(frozen=True, eq=False)
class View:
    """One view of a scene.

    Attributes:
        image_from_layout: (N, 2) mm to px of the whole image.
        xyz_from_layout: (N, 2) mm to (N, 3) mm, the surface in space.
        area: x, y, width, height of its part of the image.
        mirrored: the pattern's back is seen.
        h: (3, 3) image from layout; None where straight lines do not stay straight.
    """

    image_from_layout: Map
    xyz_from_layout: Map
    area: Area
    mirrored: bool
    h: Points | None

    @property
    def curved(self) -> bool:
        return self.h is None

    @property
    def window(self) -> tuple[slice, slice, slice]:
        """The area's place in planes (3, H, W)."""
        x, y, width, height = self.area
        return slice(None), slice(y, y + height), slice(x, x + width)

    def area_from_layout(self, xy_mm: Points) -> Points:
        """(N, 2) mm to px, counted from the area's own top left pixel."""
        at = self.image_from_layout(xy_mm)
        return at - self.area[:2] if any(self.area[:2]) else at

    def contains(self, xy_px: Points) -> NDArray[np.bool_]:
        """Which of the points (N, 2) px of the image lie in the area."""
        corner, size = np.asarray(self.area[:2]), np.asarray(self.area[2:])
        inside = (xy_px >= corner - 0.5) & (xy_px < corner + size - 0.5)
        return np.asarray(inside.all(axis=1))


def look(scene: Scene, size: tuple[int, int]) -> View:
    """The only view of a scene.

    Raises:
        SceneError: it has several; the surface folds; a part lies behind the camera or turns away from it.
    """
    if isinstance(scene.camera, tuple) and len(scene.camera) > 1:
        raise SceneError(
            f"the scene has {len(scene.camera)} views, one is needed; take the scene with camera = one of them"
        )
    return views(scene, size)[0]


def views(scene: Scene, size: tuple[int, int]) -> tuple[View, ...]:
    """All views of a scene in an image of ``size`` (width, height).

    Raises:
        SceneError: the surface folds; a part lies behind a camera or turns away from it; views overlap.
    """
    cameras = scene.camera if isinstance(scene.camera, tuple) else (scene.camera,)
    areas = [_area(camera, size) for camera in cameras]
    _require_apart(areas, cameras)
    lift = _lift(scene)
    return tuple(_view(scene, camera, area, lift, size) for camera, area in zip(cameras, areas, strict=True))


def _area(camera: Camera | Pinhole, size: tuple[int, int]) -> Area:
    if isinstance(camera, Camera) or camera.area_px is None:
        return (0, 0, *size)
    x, y, width, height = camera.area_px
    if x + width > size[0] or y + height > size[1]:
        raise SceneError(
            f"area_px {camera.area_px}{_of(camera)} leaves the image of {size[0]} x {size[1]} px; "
            "make the area smaller or the image larger"
        )
    return camera.area_px


def _require_apart(areas: list[Area], cameras: tuple[Camera | Pinhole, ...]) -> None:
    for i, (x, y, width, height) in enumerate(areas):
        for j in range(i):
            other_x, other_y, other_width, other_height = areas[j]
            if min(x + width, other_x + other_width) > max(x, other_x) and (
                min(y + height, other_y + other_height) > max(y, other_y)
            ):
                raise SceneError(
                    f"the views {_name(cameras[j], j)} and {_name(cameras[i], i)} share pixels of the image: "
                    f"area_px {areas[j]} and {areas[i]}; give each its own area_px"
                )


def _name(camera: Camera | Pinhole, number: int) -> str:
    return getattr(camera, "name", "") or str(number)


def _of(camera: Camera | Pinhole) -> str:
    name = getattr(camera, "name", "")
    return f" of view {name}" if name else ""


@dataclass(frozen=True, eq=False)
class _Lift:
    """The surface as it was given, whether it leads out of the plane, and where it is checked."""

    surface: Map | None
    spatial: bool
    checked_mm: Points
    step_mm: float

    def __call__(self, xy_mm: Points) -> Points:
        """(N, 2) mm to (N, 3) mm."""
        at = xy_mm if self.surface is None else self.surface(xy_mm)
        return at if at.shape[1] == 3 else np.column_stack([at, np.zeros(len(at))])


def _lift(scene: Scene) -> _Lift:
    layout, surface = scene.layout, scene.surface
    checked = points_to_check(layout.marker_xy_mm, layout.cell_corners)
    step_mm = 1e-4 * pitch_mm(layout)
    spatial = surface is not None and surface(checked[:1]).shape[1] == 3
    if surface is not None and not spatial:
        require_no_fold(surface, checked, step_mm)
    return _Lift(surface, spatial, checked, step_mm)


def _view(scene: Scene, camera: Camera | Pinhole, area: Area, lift: _Lift, size: tuple[int, int]) -> View:
    if isinstance(camera, Camera) and not lift.spatial:
        return _planar_view(scene, camera, area, lift, size)
    at = camera if isinstance(camera, Pinhole) else pinhole(camera, scene.layout, size)
    h = at.homography if lift.surface is None else None
    view = View(lambda xy_mm: project_3d(at, lift(xy_mm)), lift, area, at.mirrored, h)
    if view.curved:
        _require_facing(view, lift, _of(camera))
    return view


def _planar_view(scene: Scene, camera: Camera, area: Area, lift: _Lift, size: tuple[int, int]) -> View:
    h, surface = homography(camera, scene.layout, size), lift.surface
    mirrored = is_mirrored(camera, scene.layout)
    if surface is None:
        return View(lambda xy_mm: project(h, xy_mm), lift, area, mirrored, h)
    return View(lambda xy_mm: project(h, surface(xy_mm)), lift, area, mirrored, None)


def _require_facing(view: View, lift: _Lift, of: str) -> None:
    """The map's Jacobian determinant has the sign of the surface at rest everywhere."""
    jacobian = determinant(view.image_from_layout, lift.checked_mm, lift.step_mm)
    facing = jacobian if view.mirrored else -jacobian
    if not (facing > 0).all():
        x, y = lift.checked_mm[int(np.argmin(np.where(np.isnan(facing), -np.inf, facing)))]
        raise SceneError(
            f"the surface turns away from the camera{of} at ({x:.3g}, {y:.3g}) mm of the layout; "
            "take a smaller displacement, a larger radius or a camera that looks more steeply"
        )
