"""The clear layers before a camera: a window and a gel with flat, parallel faces, at which light is refracted.

A ray from a point in the gel to the camera crosses the window's outer face at the offset x from the camera's normal to
the window. With s = x / sqrt(x^2 + h^2), the sine of its angle in air, Snell's law gives the point's own offset,

    r(x) = x + w s / sqrt(n_w^2 - s^2) + g s / sqrt(n_g^2 - s^2)

for the distance h from the camera to the window, the thickness w of the window and g of the gel before the point.
Newton's method solves for x; r is increasing and concave for indices from 1 on, so that it converges from below.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import STRICT, SceneError

Points = NDArray[np.float64]

MAX_MM, MAX_INDEX = 1000.0, 4.0
MAX_STEPS = 50  # of Newton's method
CONVERGED = 1e-8  # of a step, relative to the offset and the distances: the error is about its square
ON_WINDOW_MM = 1e-9  # rounding of a pattern that lies on the window


@dataclass(frozen=True)
class Medium:
    """The layers between the pattern and the camera; a layer of 0 mm is absent.

    Attributes:
        gel_mm: thickness of the clear gel, from the pattern at rest to the window.
        gel_index: the gel's index of refraction; needed where there is gel.
        window_mm: thickness of the window.
        window_index: the window's index of refraction; needed where there is a window.
    """

    __pydantic_config__: ClassVar = STRICT

    gel_mm: float = 0.0
    gel_index: float | None = None
    window_mm: float = 0.0
    window_index: float | None = None

    def __post_init__(self) -> None:
        for layer in ("gel", "window"):
            mm, index = getattr(self, f"{layer}_mm"), getattr(self, f"{layer}_index")
            if not 0 <= mm <= MAX_MM:
                raise SceneError(f"{layer}_mm is {mm:g}; it must lie between 0 and {MAX_MM:g} mm")
            if mm > 0 and index is None:
                raise SceneError(
                    f"{layer}_index is missing; give the {layer}'s index of refraction "
                    "(silicone about 1.41, acrylic 1.49, glass 1.52)"
                )
            if index is not None and not 1 <= index <= MAX_INDEX:
                raise SceneError(f"{layer}_index is {index:g}; it must lie between 1 and {MAX_INDEX:g}")

    @property
    def is_air(self) -> bool:
        """Whether both layers are absent."""
        return self.gel_mm == 0 and self.window_mm == 0


class WindowPlane(NamedTuple):
    """The window's outer face in a camera's frame.

    Attributes:
        normal: (x, y, z), away from the camera, of any length.
        distance_mm: from the camera to the plane.
    """

    normal: tuple[float, float, float]
    distance_mm: float


def window_at_rest(medium: Medium, rotation: Points, shift_mm: Points) -> WindowPlane:
    """The window that is parallel to the pattern at rest, ``gel_mm`` before it.

    Args:
        medium: the layers.
        rotation: (3, 3), camera from layout.
        shift_mm: (3,), camera from layout.

    Raises:
        SceneError: the camera stands in the medium.
    """
    axis = rotation[:, 2]
    height = float(axis @ shift_mm)
    distance_mm = abs(height) - medium.gel_mm - medium.window_mm
    if not distance_mm > 0:
        raise SceneError(
            f"the camera stands {abs(height):.3g} mm from the pattern's plane, within [medium] gel_mm + window_mm = "
            f"{medium.gel_mm + medium.window_mm:.3g} mm; move the camera away"
        )
    x, y, z = (float(v) for v in (axis if height > 0 else -axis))
    return WindowPlane((x, y, z), distance_mm)


def points_on_window(medium: Medium, window: WindowPlane, xyz_mm: Points) -> Points:
    """Where the light of points leaves the window: (N, 3) mm for points (N, 3) mm, all in the camera's frame.

    Raises:
        SceneError: a point lies in the window.
    """
    normal = np.asarray(window.normal) / np.linalg.norm(window.normal)
    height = xyz_mm @ normal
    gel_mm = height - window.distance_mm - medium.window_mm
    if not gel_mm.min(initial=0.0) >= -ON_WINDOW_MM:
        raise SceneError(
            f"a part of the pattern lies in the window, {-gel_mm.min():.3g} mm beyond its inner face; press less, or "
            "make [medium] gel_mm larger"
        )
    beside = xyz_mm - height[:, None] * normal
    offset = np.linalg.norm(beside, axis=1)
    crossing = _crossing_offset(medium, window.distance_mm, np.maximum(gel_mm, 0.0), offset)
    share = np.divide(crossing, offset, out=np.zeros_like(offset), where=offset > 0)
    return np.asarray(window.distance_mm * normal + share[:, None] * beside)


def _crossing_offset(medium: Medium, h: float, gel_mm: Points, offset: Points) -> Points:
    """(N,) x with r(x) = ``offset`` (N,), see the module."""
    layers = ((medium.window_mm, medium.window_index), (gel_mm, medium.gel_index if medium.gel_mm else 1.0))
    x = offset * h / (h + medium.window_mm + gel_mm)
    for _ in range(MAX_STEPS):
        length = np.hypot(x, h)
        sine, slope_of_sine = x / length, h**2 / length**3
        reached, slope = x.copy(), np.ones_like(x)
        for thickness, index in layers:
            square = (index or 1.0) ** 2
            reached += thickness * sine / np.sqrt(square - sine**2)
            slope += thickness * square / (square - sine**2) ** 1.5 * slope_of_sine
        step = (offset - reached) / slope
        x = x + step
        if not (np.abs(step) > CONVERGED * length).any():
            break
    return np.asarray(x)
