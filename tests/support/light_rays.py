"""Light through a window and a gel, ray by ray: Snell's law in its vector form at one face after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Slab(NamedTuple):
    """A window and the medium behind the window, in a camera's frame: the outer face is n x = ``distance_mm``."""

    normal: Array
    distance_mm: float
    window_mm: float
    window_index: float
    gel_index: float


def slab_at_rest(
    rotation: Array, shift_mm: Array, gel: tuple[float, float], window: tuple[float, float]
) -> Slab:
    """The window that is parallel to the pattern at rest; ``gel`` and ``window`` are thickness in mm and index."""
    middle = rotation[:, 2] @ shift_mm
    normal = rotation[:, 2] * np.sign(middle)
    return Slab(normal, abs(middle) - gel[0] - window[0], *window, gel[1])


def refracted(direction: Array, normal: Array, before: float, behind: float) -> Array:
    """(N, 3) unit vectors behind a face, of unit vectors (N, 3) before the face with the given ``normal``."""
    ratio = before / behind
    cosine = direction @ normal
    inner = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    return np.asarray(ratio * direction + (inner - ratio * cosine)[:, None] * normal)


def carried(start: Array, direction: Array, normal: Array, height_mm: float) -> Array:
    """(N, 3) where lines meet the plane n x = ``height_mm``."""
    return np.asarray(start + direction * ((height_mm - start @ normal) / (direction @ normal))[:, None])


def from_camera(slab: Slab, direction: Array) -> tuple[Array, Array]:
    """(N, 3) where rays (N, 3) from the camera leave the window's inner face, and (N, 3) how they go on."""
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    outer = carried(np.zeros_like(direction), direction, slab.normal, slab.distance_mm)
    glass = refracted(direction, slab.normal, 1.0, slab.window_index)
    inner = carried(outer, glass, slab.normal, slab.distance_mm + slab.window_mm)
    return inner, refracted(glass, slab.normal, slab.window_index, slab.gel_index)


def to_camera(slab: Slab, start: Array, direction: Array) -> tuple[Array, Array]:
    """The other way: (N, 3) where rays from points in the gel leave the outer face, (N, 3) their direction in air."""
    inner = carried(start, direction, slab.normal, slab.distance_mm + slab.window_mm)
    glass = refracted(direction, -slab.normal, slab.gel_index, slab.window_index)
    outer = carried(inner, glass, slab.normal, slab.distance_mm)
    return outer, refracted(glass, -slab.normal, slab.window_index, 1.0)
