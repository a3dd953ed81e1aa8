"""The clear layers between the camera and the pattern: a window and a gel with flat faces that refract light.

All faces are parallel planes. n is their unit normal, away from the camera, h > 0 the distance from the camera to the
window's outer face. By Snell's law a ray that leaves the camera under an angle to n whose tangent is q lies, behind
the window (thickness w, index n_w) and g mm of gel (index n_g),

    r(q) = q (h + w k(q; n_w) + g k(q; n_g)),    k(q; m) = 1 / sqrt(m^2 + (m^2 - 1) q^2)

beside the normal through the camera. For indices from 1 on, r increases and is concave in q, so that Newton's method
from q = r / (h + w + g), which lies below the solution, increases to it. The flat port of underwater cameras is the
same geometry (Treibitz, Schechner, Kunz and Singh, Flat refractive geometry, PAMI 34 (2012) 51).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.errors import RigError

Array = NDArray[np.float64]

MAX_ITERATIONS = 50  # of Newton's method; about 5 are needed
CONVERGED = 1e-9  # last step, of 1 + q: the error is about its square
TOUCHING_MM = 1e-9  # rounding of a pattern that lies on the window
MAX_THICKNESS_MM, MAX_INDEX = 1000.0, 4.0


@dataclass(frozen=True)
class Medium:
    """A gel and a window between the pattern and the camera; a layer of 0 mm is absent.

    Attributes:
        gel_mm: thickness of the gel, from the pattern at rest to the window, along the window's normal.
        gel_index: its index of refraction; needed where there is gel.
        window_mm: thickness of the window.
        window_index: its index of refraction; needed where there is a window.

    Raises:
        RigError: a value that is impossible for a layer.
    """

    gel_mm: float = 0.0
    gel_index: float | None = None
    window_mm: float = 0.0
    window_index: float | None = None

    def __post_init__(self) -> None:
        for layer in ("gel", "window"):
            thickness, index = getattr(self, f"{layer}_mm"), getattr(self, f"{layer}_index")
            if not 0 <= thickness <= MAX_THICKNESS_MM:
                raise RigError(
                    f"medium.{layer}_mm is {thickness:g}; expected a number from 0 to {MAX_THICKNESS_MM:g} mm"
                )
            if index is None and thickness > 0:
                raise RigError(
                    f"medium.{layer}_index is missing; expected the {layer}'s index of refraction "
                    "(silicone about 1.41, acrylic 1.49, glass 1.52)"
                )
            if index is not None and not 1 <= index <= MAX_INDEX:
                raise RigError(
                    f"medium.{layer}_index is {index:g}; expected a number from 1 to {MAX_INDEX:g}"
                )

    @property
    def is_air(self) -> bool:
        """Whether both layers are absent."""
        return self.gel_mm == 0 and self.window_mm == 0

    @property
    def apparent_shift_mm(self) -> float:
        """The apparent shift of the pattern at rest towards the camera, for a ray along the normal."""
        return self.window_mm * (1 - 1 / self._window_index) + self.gel_mm * (1 - 1 / self._gel_index)

    @property
    def _gel_index(self) -> float:
        return self.gel_index if self.gel_mm > 0 and self.gel_index is not None else 1.0

    @property
    def _window_index(self) -> float:
        return self.window_index if self.window_mm > 0 and self.window_index is not None else 1.0


class WindowPlane(NamedTuple):
    """The window's outer face in the camera's frame.

    Attributes:
        normal: (x, y, z), a unit vector away from the camera.
        distance_mm: from the camera to the plane.
    """

    normal: tuple[float, float, float]
    distance_mm: float


class PlacedWindow(NamedTuple):
    """A window's outer face in a camera's frame, and its derivatives by the pattern's pose (see ``Linearisation``).

    Attributes:
        medium: the layers.
        normal: (3,) float64, a unit vector away from the camera.
        distance_mm: from the camera to the plane; not above 0 where the camera would stand within the medium.
        normal_by_pose: (3, 6) float64.
        distance_by_pose: (6,) float64.
    """

    medium: Medium
    normal: Array
    distance_mm: float
    normal_by_pose: Array
    distance_by_pose: Array


class Directions(NamedTuple):
    """The directions in which a camera sees N points, in its frame; NaN for points that it does not see.

    Attributes:
        xyz: (N, 3) float64, of any length.
        by_point: (N, 3, 3) float64, derivatives by the points in the camera's frame.
        by_pose: (N, 3, 6) float64, derivatives by the pattern's pose.
    """

    xyz: Array
    by_point: Array
    by_pose: Array


class Lines(NamedTuple):
    """N lines of sight behind the window; NaN without a line of sight.

    Attributes:
        origin_mm: (N, 3) float64, a point of each line.
        direction: (N, 3) float64, unit vectors away from the camera.
    """

    origin_mm: Array
    direction: Array


def place_window(medium: Medium, plane: WindowPlane | None, rotation: Array, shift_mm: Array) -> PlacedWindow:
    """The window before a camera with the pose x_camera = rotation x_layout + shift.

    Args:
        medium: the layers.
        plane: the window's outer face in the camera's frame; None: the window is parallel to the pattern at rest, and
            ``gel_mm`` lies between the two.
        rotation: (3, 3).
        shift_mm: (3,).
    """
    if plane is not None:
        return PlacedWindow(medium, np.array(plane.normal), plane.distance_mm, np.zeros((3, 6)), np.zeros(6))
    normal = rotation[:, 2] if rotation[:, 2] @ shift_mm > 0 else -rotation[:, 2]
    normal_by_pose = np.column_stack([-cross_matrix(normal[None])[0], np.zeros((3, 3))])
    distance_by_pose = shift_mm @ normal_by_pose + np.concatenate([np.zeros(3), normal])
    distance_mm = float(normal @ shift_mm) - medium.gel_mm - medium.window_mm
    return PlacedWindow(medium, normal, distance_mm, normal_by_pose, distance_by_pose)


def gel_depth_mm(window: PlacedWindow, xyz_mm: Array) -> Array:
    """(N,) the gel between the window and points (N, 3) mm in the camera's frame.

    NaN for points within the window, and for all points where the camera would stand within the medium.
    """
    depth = xyz_mm @ window.normal - window.distance_mm - window.medium.window_mm
    seen = (depth >= -TOUCHING_MM) & (window.distance_mm > 0)
    return np.asarray(np.where(seen, np.maximum(depth, 0.0), np.nan))


def refract_points(window: PlacedWindow, rotated: Array, shift_mm: Array) -> Directions:
    """The directions in which the camera sees points through window and gel.

    Args:
        window: in the camera's frame.
        rotated: (N, 3) mm, the points along the camera's axes, from the layout's origin.
        shift_mm: (3,) the layout's origin in the camera's frame.
    """
    medium, n, h = window.medium, window.normal, window.distance_mm
    camera = rotated + shift_mm
    gel = gel_depth_mm(window, camera)
    beside = camera - (camera @ n)[:, None] * n
    radius = np.linalg.norm(beside, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        outward = np.where(radius[:, None] > 0, beside / radius[:, None], 0.0)
    tangent = _solve_tangent(medium, h, gel, radius)
    depth, slope = _apparent_depth(medium, h, gel, tangent)
    in_gel = tangent * _sideways(tangent, medium._gel_index)
    radial = outward[:, :, None] * outward[:, None, :]
    # by the part of the point across the normal
    across = radial / slope[:, None, None] + (np.eye(3) - radial) / depth[:, None, None]
    along = outward * (in_gel / slope)[:, None]
    by_point = across - across @ n[:, None] * n - along[:, :, None] * n
    by_normal = (
        np.eye(3)
        - (n[:, None] / depth[:, None, None] + along[:, :, None]) * beside[:, None, :]
        - (camera @ n)[:, None, None] * across
    )
    by_distance = outward * ((in_gel - tangent) / slope)[:, None]
    by_pose = by_point @ _point_by_pose(rotated) + by_normal @ window.normal_by_pose
    by_pose += by_distance[:, :, None] * window.distance_by_pose
    return Directions(n + outward * tangent[:, None], by_point, by_pose)


def refract_rays(window: PlacedWindow, direction: Array) -> Lines:
    """The lines of sight behind the window, in the camera's frame, of rays (N, 3) that leave the camera."""
    medium, n, h = window.medium, window.normal, window.distance_mm
    forward = direction @ n
    forward = np.where((forward > 0) & (h > 0), forward, np.nan)
    beside = direction / forward[:, None] - n
    tangent = np.linalg.norm(beside, axis=1)
    sideways = h + medium.window_mm * _sideways(tangent, medium._window_index)
    origin = (h + medium.window_mm) * n + beside * sideways[:, None]
    inner = n + beside * _sideways(tangent, medium._gel_index)[:, None]
    return Lines(origin, np.asarray(inner / np.linalg.norm(inner, axis=1, keepdims=True)))


def _sideways(tangent: Array, index: float) -> Array:
    """(N,) k(q; m), see the module: the sideways offset per depth, over q."""
    return np.asarray(1 / np.sqrt(index**2 + (index**2 - 1) * tangent**2))


def _apparent_depth(medium: Medium, distance_mm: float, gel_mm: Array, tangent: Array) -> tuple[Array, Array]:
    """(N,) r / q and (N,) dr / dq, see the module."""
    in_window, in_gel = (_sideways(tangent, m) for m in (medium._window_index, medium._gel_index))
    depth = distance_mm + medium.window_mm * in_window + gel_mm * in_gel
    slope = distance_mm + medium.window_mm * medium._window_index**2 * in_window**3
    return depth, slope + gel_mm * medium._gel_index**2 * in_gel**3


def _solve_tangent(medium: Medium, distance_mm: float, gel_mm: Array, radius_mm: Array) -> Array:
    """(N,) q with r(q) = ``radius_mm``, see the module; NaN where ``gel_mm`` is."""
    tangent = np.asarray(radius_mm / (distance_mm + medium.window_mm + gel_mm))
    for _ in range(MAX_ITERATIONS):
        depth, slope = _apparent_depth(medium, distance_mm, gel_mm, tangent)
        step = (radius_mm - tangent * depth) / slope
        tangent = tangent + step
        if not (np.abs(step) > CONVERGED * (1 + tangent)).any():
            break
    return tangent


def _point_by_pose(rotated: Array) -> Array:
    """(N, 3, 6) derivatives of points (N, 3), along the camera's axes from the layout's origin, by the pose."""
    return np.concatenate([-cross_matrix(rotated), np.tile(np.eye(3), (len(rotated), 1, 1))], axis=2)


def cross_matrix(vectors: Array) -> Array:
    """(N, 3, 3) the matrices [v]x of vectors (N, 3): [v]x w is the cross product of v and w."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = vectors.T
    out[:, 1, 2], out[:, 2, 0], out[:, 0, 1] = -vectors.T
    return out
