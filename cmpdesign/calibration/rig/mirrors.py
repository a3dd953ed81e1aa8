"""The mirrors that two views of one camera imply.

A view through a mirror is a virtual camera, x = (I - 2 m m') y + 2 e m for a point y in the real camera's frame and
the mirror m'y = e. Between two such views lies the product of two reflections: a turn by twice the angle of the mirrors
about the line in which they meet, without a shift along this line. A turn of both mirrors and of the pattern about that
line changes no picture, so the views do not determine it; the planes are those of a camera that faces the pattern.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.rig.unknowns import Unknowns
from extractor import View

Array = NDArray[np.float64]


class MirrorPlane(NamedTuple):
    """A mirror in its camera's frame: normal' y = distance_mm."""

    normal: Array
    distance_mm: float


@dataclass(frozen=True, eq=False)
class MirrorPair:
    """The mirrors of two mirrored views of one camera.

    Attributes:
        views: their names.
        normals: of their mirrors, in the frame of the camera, which faces the pattern.
        distances_mm: of their mirrors: normal' y = distance_mm.
        angle_deg: between the mirrors.
        shift_mm: along the line in which the mirrors meet, between the views; 0 for two plane mirrors.
    """

    views: tuple[str, str]
    normals: tuple[tuple[float, ...], tuple[float, ...]]
    distances_mm: tuple[float, float]
    angle_deg: float
    shift_mm: float


def mirror_pairs(unknowns: Unknowns, views: tuple[View, ...]) -> tuple[MirrorPair, ...]:
    """The pairs of mirrored views that share a camera, each with the first one."""
    pairs = []
    for numbers in unknowns.cameras:
        mirrored = [views[n] for n in numbers if views[n].mirrored]
        pairs += [_pair(mirrored[0], other) for other in mirrored[1:]]
    return tuple(pair for pair in pairs if pair is not None)


def _pair(first: View, second: View) -> MirrorPair | None:
    turn = first.R_camera_from_layout @ second.R_camera_from_layout.T
    shift = first.t_camera_from_layout_mm - turn @ second.t_camera_from_layout_mm
    vector = np.asarray(cv2.Rodrigues(turn)[0])[:, 0]
    angle = float(np.linalg.norm(vector))
    if angle < 1e-6:
        return None
    axis = vector / angle
    # a point of the line: the fixed point of the turn and shift
    across = shift - (axis @ shift) * axis
    point = np.linalg.lstsq(np.eye(3) - turn, across, rcond=None)[0]
    one, other = _planes(first, axis, point, angle)
    return MirrorPair(
        views=(first.name, second.name),
        normals=(tuple(one.normal.tolist()), tuple(other.normal.tolist())),
        distances_mm=(one.distance_mm, other.distance_mm),
        angle_deg=float(np.degrees(angle / 2)),
        shift_mm=float(axis @ shift),
    )


def _planes(first: View, axis: Array, point: Array, angle: float) -> tuple[MirrorPlane, MirrorPlane]:
    """The planes through the line, half the turn apart, for which the real camera faces the pattern most."""
    start = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
    start /= np.linalg.norm(start)
    facing = first.R_camera_from_layout[:, 2] * np.sign(
        first.R_camera_from_layout[:, 2] @ first.t_camera_from_layout_mm
    )
    best, least = start, -np.inf
    # the pattern's normal, reflected, has the largest part along the camera's axis
    along = axis @ facing
    across = facing - along * axis
    wanted = np.array([0.0, 0, 1]) - axis[2] * axis
    for sign in (1.0, -1.0):
        bisector = across / np.linalg.norm(across) - sign * wanted / np.linalg.norm(wanted)
        if np.linalg.norm(bisector) < 1e-9:
            bisector = np.cross(axis, wanted)
        normal = bisector / np.linalg.norm(bisector)
        seen = facing - 2 * (normal @ facing) * normal
        if seen[2] > least:
            best, least = normal, float(seen[2])
    turn = np.asarray(cv2.Rodrigues(-axis * angle / 2)[0])
    out = []
    for normal in (best, turn @ best):
        distance_mm = float(normal @ point)
        sign = 1.0 if distance_mm >= 0 else -1.0
        out.append(MirrorPlane(sign * normal, sign * distance_mm))
    return out[0], out[1]
