"""Views of known surfaces for the tests of reconstruction: pictures by OpenCV's own projection, with known noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene import Optics, Pinhole, Plain, Rendered, Scene, Sensor, render
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import Markers, Reference, Rig, Status, View, parse_layout
from tests.support.layouts import small_layout, small_text

Array = NDArray[np.float64]

PITCH_MM = 1.5  # of the small layouts
DISTORTION = (-0.12, 0.05, 0.001, -0.0015, 0.01)


def reference(pattern: str = "honeycomb", layers: int = 5) -> Reference:
    return parse_layout(small_text(pattern, layers))


def looking(
    name: str,
    *,
    tilt_deg: float,
    azimuth_deg: float = 0.0,
    distance_mm: float = 40.0,
    roll_deg: float = 0.0,
    mirrored: bool = False,
    back: bool = True,
    focal_px: float = 900.0,
    distortion: tuple[float, ...] = DISTORTION,
) -> View:
    """A view of the layout's origin from a direction; through a mirror its picture is turned over."""
    tilt, azimuth, roll = np.radians([tilt_deg, azimuth_deg, roll_deg])
    side = -1.0 if back else 1.0
    position = distance_mm * np.array(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), side * np.cos(tilt)]
    )
    forward = -position / distance_mm
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    rotation = np.diag([-1.0 if mirrored else 1.0, 1, 1]) @ turn @ rotation
    focal = (focal_px, 1.01 * focal_px)
    return View(name, focal, (322.3, 236.8), distortion, None, None, rotation, -rotation @ position)


def pair(half_angle_deg: float = 15.0, mirrored: tuple[bool, bool] = (False, False)) -> tuple[View, View]:
    """Two views from the back, left and right of the pattern's normal."""
    return (
        looking("left", tilt_deg=half_angle_deg, azimuth_deg=180, roll_deg=3, mirrored=mirrored[0]),
        looking("right", tilt_deg=half_angle_deg, azimuth_deg=8, roll_deg=-5, mirrored=mirrored[1]),
    )


def unplaced(views: tuple[View, ...]) -> Rig:
    """The same views as a rig file has them: without poses."""
    return Rig(
        tuple(replace(view, R_camera_from_layout=None, t_camera_from_layout_mm=None) for view in views)
    )


def opencv_px(view: View, xyz_mm: Array) -> Array:
    """(N, 2) px by ``cv2.projectPoints``, which accepts rotations only: a mirrored view's x is turned over."""
    flip = np.diag([-1.0, 1, 1]) if view.mirrored else np.eye(3)
    rotation, shift = flip @ view.R_camera_from_layout, flip @ view.t_camera_from_layout_mm
    if view.mirrored:  # x = -x' : the same as a negative focal length, with the tangential p2 turned over
        matrix = np.diag([-view.focal_px[0], view.focal_px[1], 1.0])
        k1, k2, p1, p2, k3 = view.distortion
        bent = (k1, k2, p1, -p2, k3)
    else:
        matrix = np.diag([view.focal_px[0], view.focal_px[1], 1.0])
        bent = view.distortion
    matrix[:2, 2] = view.centre_px
    pixels, _ = cv2.projectPoints(xyz_mm[:, None], cv2.Rodrigues(rotation)[0], shift, matrix, np.array(bent))
    return np.asarray(pixels[:, 0], np.float64)


def noisy(
    layout: Reference, view: View, xyz_mm: Array, rng: np.random.Generator, sigma_px: float = 0.02
) -> Markers:
    """The simulated result of an extractor for a view: anisotropic noise, and its covariance."""
    count = len(xyz_mm)
    angle = rng.uniform(0, np.pi, count)
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.stack([np.stack([cos, -sin], 1), np.stack([sin, cos], 1)], 1)
    axes = sigma_px * np.stack([rng.uniform(0.5, 1.0, count), rng.uniform(1.0, 3.0, count)], 1)
    noise = np.einsum("nij,nj->ni", turn, axes * rng.standard_normal((count, 2)))
    cov = turn @ (axes[:, :, None] ** 2 * np.swapaxes(turn, 1, 2))
    appears = bool(np.linalg.det(view.R_camera_from_layout) * view.position_mm[2] < 0)
    edges, virtual = len(layout.edges), layout.virtual_per_edge
    return Markers(
        xy_px=(opencv_px(view, xyz_mm) if view.medium is None else view.project(xyz_mm)) + noise,
        cov_px2=cov,
        status=np.full(count, Status.MEASURED, np.uint8),
        virtual_xy_px=np.full((edges, virtual, 2), np.nan),
        virtual_cov_px2=np.full((edges, virtual, 2, 2), np.nan),
        virtual_status=np.zeros((edges, virtual), np.uint8),
        mirrored=appears,
        reason=None,
        timings_ms=MappingProxyType({}),
    )


def flat(layout: Reference) -> Array:
    return np.column_stack([layout.xy_mm, np.zeros(len(layout.xy_mm))])


def pressed(xy_mm: Array, depth_mm: float = 1.0) -> Array:
    """A smooth dent with sideways motion: (N, 3) mm at layout places (N, 2)."""
    dent = np.exp(-(((xy_mm - (1.0, -0.5)) / 3.0) ** 2).sum(axis=1))
    moved = np.column_stack([0.3 * dent * xy_mm[:, 0], 0.2 * dent, -depth_mm * dent])
    return np.column_stack([xy_mm, np.zeros(len(xy_mm))]) + moved


HALF = (480, 360)  # of the binocular image
SMALL = 8  # layers


def contact(xy_mm: Array) -> Array:
    """A dent as wide as contacts are, with sideways motion."""
    dent = np.exp(-(((xy_mm - (1.0, -0.5)) / 5.0) ** 2).sum(axis=1))
    return np.column_stack([xy_mm + np.outer(dent, (0.6, -0.3)), -1.5 * dent])


def binocular(
    layers: int = SMALL, *, mirror: bool = False, half: tuple[int, int] = HALF
) -> tuple[Pinhole, ...]:
    """Two views from the back that share one image, as mirrors make them: the left and the right half."""
    width, height = half
    return tuple(
        Pinhole.looking(
            (2 * width, height),
            distance_mm=2.8 * PITCH_MM * layers,
            field_of_view_deg=50.0,
            tilt_deg=20.0,
            azimuth_deg=azimuth,
            roll_deg=roll,
            back=True,
            mirror=mirror,
            distortion=(-0.05, 0.02, 0.0005, -0.0003, 0.0),
            area_px=(k * width, 0, width, height),
            name=name,
        )
        for k, (name, azimuth, roll) in enumerate((("left", 180.0, 2.0), ("right", 0.0, -1.0)))
    )


def binocular_scene(surface: Callable[[Array], Array] | None = None, seed: int = 0, **options: Any) -> Scene:
    layers = options.pop("layers", SMALL)
    return Scene(
        layout=small_layout("honeycomb", layers),
        camera=binocular(layers, **options),
        surface=surface,
        background=Plain(BLACK_RGB),
        optics=Optics(0.8),
        sensor=Sensor(noise=2.0),
        inks=INKS,
        seed=seed,
    )


def binocular_shot(
    surface: Callable[[Array], Array] | None = None, seed: int = 0, **options: Any
) -> Rendered:
    width, height = options.get("half", HALF)
    return render(binocular_scene(surface, seed, **options), size=(2 * width, height))


def rig_of(cameras: tuple[Pinhole, ...]) -> Rig:
    """The content of a rig file: intrinsics and areas, no poses."""
    return Rig(
        tuple(
            View(
                c.name,
                c.focal_px,
                c.centre_px,
                c.distortion,
                c.area_px,
                np.linalg.det(c.R_camera_from_layout) < 0,
            )
            for c in cameras
        )
    )


def rig_text(rig: Rig) -> str:
    """The rig as a file's text."""
    tables = [
        f'[[view]]\nname = "{view.name}"\nfocal_px = {list(view.focal_px)}\ncentre_px = {list(view.centre_px)}\n'
        f"distortion = {list(view.distortion)}\narea_px = {list(view.area_px or ())}\n"
        f"mirrored = {str(view.mirrored).lower()}\n"
        for view in rig.views
    ]
    return "\n".join(tables)
