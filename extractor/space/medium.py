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
    """A window's outer face in a camera's frame, and its derivatives by the pattern's pose (see ``Linearisation``);
    native loops read it.

    Attributes:
        is_there: False in air.
        gel_index, window_mm, window_index: the layers.
        normal: (3,) float64, a unit vector away from the camera.
        distance_mm: from the camera to the plane; not above 0 where the camera would stand within the medium.
        normal_by_pose: (3, 6) float64.
        distance_by_pose: (6,) float64.
    """

    is_there: bool
    gel_index: float
    window_mm: float
    window_index: float
    normal: Array
    distance_mm: float
    normal_by_pose: Array
    distance_by_pose: Array


NO_WINDOW = PlacedWindow(False, 1.0, 0.0, 1.0, np.zeros(3), 0.0, np.zeros((3, 6)), np.zeros(6))


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
    layers = True, medium._gel_index, medium.window_mm, medium._window_index
    if plane is not None:
        return PlacedWindow(*layers, np.array(plane.normal), plane.distance_mm, np.zeros((3, 6)), np.zeros(6))
    normal = np.ascontiguousarray(rotation[:, 2] if rotation[:, 2] @ shift_mm > 0 else -rotation[:, 2])
    normal_by_pose = np.column_stack([-cross_matrix(normal[None])[0], np.zeros((3, 3))])
    distance_by_pose = shift_mm @ normal_by_pose + np.concatenate([np.zeros(3), normal])
    distance_mm = float(normal @ shift_mm) - medium.gel_mm - medium.window_mm
    return PlacedWindow(*layers, normal, distance_mm, normal_by_pose, distance_by_pose)


def cross_matrix(vectors: Array) -> Array:
    """(N, 3, 3) the matrices [v]x of vectors (N, 3): [v]x w is the cross product of v and w."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = vectors.T
    out[:, 1, 2], out[:, 2, 0], out[:, 0, 1] = -vectors.T
    return out
