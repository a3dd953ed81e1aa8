"""The map from the layout to the image: the scene's surface and one of its cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.camera.pinhole import Area, Pinhole, depth_mm, project_3d
from cmpdesign.scene.camera.plain import (
    Camera,
    camera_homography,
    is_mirrored,
    pitch_mm,
    project_by_homography,
    to_pinhole,
)
from cmpdesign.scene.drawing.occlusion import Occlusion, find_occlusion, is_hidden
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.surface import fold_check_points, jacobian_determinant, require_no_fold
from cmpdesign.scene.scene import Scene

Points = NDArray[np.float64]
PointMap = Callable[[Points], Points]


@dataclass(frozen=True, eq=False)
class SceneView:
    """One view of a scene.

    Attributes:
        xyz_from_layout: (N, 2) mm to (N, 3) mm, the surface in space.
        project: (N, 3) mm to (N, 2) px of the whole image.
        area: x, y, width, height of the view's part of the image.
        mirrored: the camera sees the pattern's back.
        homography: (3, 3) image from layout; None where straight lines become curves.
        camera: the pinhole; None where the surface stays in the layout's plane and depth is not defined.
        occlusion: the parts that turn away from the camera; None: there are none.
    """

    xyz_from_layout: PointMap
    project: PointMap
    area: Area
    mirrored: bool
    homography: Points | None
    camera: Pinhole | None = None
    occlusion: Occlusion | None = None

    @property
    def curved(self) -> bool:
        return self.homography is None

    @property
    def window(self) -> tuple[slice, slice, slice]:
        """The index of the area in planes (3, H, W)."""
        x, y, width, height = self.area
        return slice(None), slice(y, y + height), slice(x, x + width)

    def image_from_layout(self, xy_mm: Points) -> Points:
        """Map (N, 2) mm to (N, 2) px of the whole image."""
        return self.project(self.xyz_from_layout(xy_mm))

    def area_from_layout(self, xy_mm: Points) -> Points:
        """Map (N, 2) mm to (N, 2) px relative to the area's top left pixel."""
        xy_px = self.image_from_layout(xy_mm)
        return xy_px - self.area[:2] if any(self.area[:2]) else xy_px

    @property
    def sign(self) -> float:
        """The sign of the Jacobian determinant of ``image_from_layout`` where the surface faces the camera."""
        return 1.0 if self.mirrored else -1.0

    @property
    def orientation(self) -> float | None:
        """The orientation of polygons that are counter-clockwise in the layout; None where all face the camera."""
        return self.sign if self.occlusion is not None else None

    @property
    def warning(self) -> str:
        """The warning that a part turns away, with share and position; empty if there is none."""
        if self.occlusion is None:
            return ""
        x, y = self.occlusion.place_mm
        name = f"view {self.camera.name}: " if self.camera and self.camera.name else ""
        return (
            f"{name}{100 * self.occlusion.share:.2g} % of the pattern turn away from the camera, among others at "
            f"({x:.3g}, {y:.3g}) mm; the hidden parts are marked as not visible"
        )

    def is_hidden(self, xy_mm: Points, step_mm: float) -> NDArray[np.bool_]:
        """(N,) bool: which points (N, 2) mm of the layout lie behind another part of the surface, or face away.

        ``step_mm`` is the step of the central differences.
        """
        if self.occlusion is None:
            return np.zeros(len(xy_mm), dtype=np.bool_)
        facing = self.sign * jacobian_determinant(self.image_from_layout, xy_mm, step_mm) > 0
        return is_hidden(self.occlusion, self.depth_from_layout(xy_mm), facing)

    def depth_from_layout(self, xy_mm: Points) -> Points:
        """Map (N, 2) mm to (N, 3): px as ``area_from_layout``, and depth before the camera in mm."""
        assert self.camera is not None
        xyz = self.xyz_from_layout(xy_mm)
        xy_px = self.project(xyz) - self.area[:2]
        return np.column_stack([xy_px, depth_mm(self.camera, xyz)])

    def contains(self, xy_px: Points) -> NDArray[np.bool_]:
        """(N,) bool: which points (N, 2) px of the image lie in the area."""
        corner, size = np.asarray(self.area[:2]), np.asarray(self.area[2:])
        inside = (xy_px >= corner - 0.5) & (xy_px < corner + size - 0.5)
        return np.asarray(inside.all(axis=1))


def single_view(scene: Scene, size: tuple[int, int]) -> SceneView:
    """The only view of a scene.

    Raises:
        SceneError: the scene has several views; the surface folds; a part lies behind the camera or turns away from it.
    """
    if isinstance(scene.camera, tuple) and len(scene.camera) > 1:
        raise SceneError(
            f"the scene has {len(scene.camera)} views, one is needed; take the scene with camera = one view"
        )
    return scene_views(scene, size)[0]


def scene_views(scene: Scene, size: tuple[int, int]) -> tuple[SceneView, ...]:
    """All views of a scene in an image of ``size`` (width, height).

    Raises:
        SceneError: the surface folds; a part lies behind a camera or turns away from it; views overlap.
    """
    cameras = scene.camera if isinstance(scene.camera, tuple) else (scene.camera,)
    areas = [_view_area(camera, size) for camera in cameras]
    _require_disjoint_areas(areas, cameras)
    surface_map = _make_surface_map(scene)
    return tuple(
        _make_view(scene, camera, area, surface_map, size)
        for camera, area in zip(cameras, areas, strict=True)
    )


def _view_area(camera: Camera | Pinhole, size: tuple[int, int]) -> Area:
    if isinstance(camera, Camera) or camera.area_px is None:
        return (0, 0, *size)
    x, y, width, height = camera.area_px
    if x + width > size[0] or y + height > size[1]:
        raise SceneError(
            f"area_px {camera.area_px}{_camera_label(camera)} leaves the image of {size[0]} x {size[1]} px; "
            "make the area smaller or the image larger"
        )
    return camera.area_px


def _require_disjoint_areas(areas: list[Area], cameras: tuple[Camera | Pinhole, ...]) -> None:
    for i, (x, y, width, height) in enumerate(areas):
        for j in range(i):
            other_x, other_y, other_width, other_height = areas[j]
            if min(x + width, other_x + other_width) > max(x, other_x) and (
                min(y + height, other_y + other_height) > max(y, other_y)
            ):
                raise SceneError(
                    f"the views {_camera_name(cameras[j], j)} and {_camera_name(cameras[i], i)} share "
                    f"pixels of the image: "
                    f"area_px {areas[j]} and {areas[i]}; give each its own area_px"
                )


def _camera_name(camera: Camera | Pinhole, number: int) -> str:
    return getattr(camera, "name", "") or str(number)


def _camera_label(camera: Camera | Pinhole) -> str:
    name = getattr(camera, "name", "")
    return f" of view {name}" if name else ""


@dataclass(frozen=True, eq=False)
class _SurfaceMap:
    """The scene's surface as a map into space; ``spatial``: the surface leaves the plane."""

    surface: PointMap | None
    spatial: bool

    def __call__(self, xy_mm: Points) -> Points:
        """Map (N, 2) mm to (N, 3) mm."""
        mapped = xy_mm if self.surface is None else self.surface(xy_mm)
        if mapped.shape[1] == 3:
            return mapped
        xyz = np.zeros((len(mapped), 3))
        xyz[:, :2] = mapped
        return xyz


def _make_surface_map(scene: Scene) -> _SurfaceMap:
    layout, surface = scene.layout, scene.surface
    if surface is None:
        return _SurfaceMap(None, False)
    spatial = surface(layout.marker_xy_mm[:1]).shape[1] == 3
    if not spatial:
        checked = fold_check_points(layout.marker_xy_mm, layout.cell_corners)
        require_no_fold(surface, checked, 1e-4 * pitch_mm(layout))
    return _SurfaceMap(surface, spatial)


def _make_view(
    scene: Scene, camera: Camera | Pinhole, area: Area, surface_map: _SurfaceMap, size: tuple[int, int]
) -> SceneView:
    is_flat = not surface_map.spatial and not scene.layout.cell_height_mm
    if isinstance(camera, Camera) and is_flat and scene.medium is None:
        return _make_planar_view(scene, camera, area, surface_map, size)
    pinhole = camera if isinstance(camera, Pinhole) else to_pinhole(camera, scene.layout, size)
    straight = surface_map.surface is None and scene.medium is None
    view = SceneView(
        surface_map,
        lambda xyz_mm: project_3d(pinhole, xyz_mm, scene.medium),
        area,
        pinhole.mirrored,
        pinhole.homography if straight else None,
        pinhole,
    )
    if not view.curved:
        return view
    return replace(view, occlusion=find_occlusion(scene.layout, view.depth_from_layout, view.sign, area[2:]))


def _make_planar_view(
    scene: Scene, camera: Camera, area: Area, surface_map: _SurfaceMap, size: tuple[int, int]
) -> SceneView:
    homography = camera_homography(camera, scene.layout, size)
    flat_homography = homography if surface_map.surface is None else None
    mirrored = is_mirrored(camera, scene.layout)
    return SceneView(
        surface_map,
        lambda xyz_mm: project_by_homography(homography, xyz_mm[:, :2]),
        area,
        mirrored,
        flat_homography,
    )
