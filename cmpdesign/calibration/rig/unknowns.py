"""What a rig's pictures may determine: parameters of its cameras, numbers of its medium, poses of its views.

Views that are parts of one image and have the same lens share a camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor import View
from extractor.space.lens import NAMES
from extractor.space.rig import MEDIUM_FIELDS, Deviation, deviated_medium

Array = NDArray[np.float64]

CAMERA_NAMES = ("fx_px", "fy_px", "cx_px", "cy_px")
POSE_NAMES = ("turn_x_rad", "turn_y_rad", "turn_z_rad", "shift_x_mm", "shift_y_mm", "shift_z_mm")
MEDIUM_STEP = 1e-4  # mm, or of an index, for derivatives by differences
# Standard deviations of a camera that was not calibrated; assumed. Of the focal length relative to it, of the
# principal point relative to the focal length, of the radial and the tangential coefficients.
FOCAL_SHARE, CENTRE_SHARE, RADIAL, TANGENTIAL = 0.02, 0.02, 0.05, 0.005


@dataclass(frozen=True, eq=False)
class Unknowns:
    """P unknowns: of the C cameras, then of the medium, then 6 for each of V views.

    Attributes:
        views: V views, whose lenses say which of them share a camera.
        medium: the uncertain numbers of the medium.
    """

    views: tuple[View, ...]
    medium: tuple[str, ...]

    @cached_property
    def cameras(self) -> tuple[tuple[int, ...], ...]:
        """The views of each camera."""
        groups: dict[object, list[int]] = {}
        for number, view in enumerate(self.views):
            lens = (view.focal_px, view.centre_px, view.lens, view.distortion)
            groups.setdefault(lens if view.area_px is not None else number, []).append(number)
        return tuple(map(tuple, groups.values()))

    @cached_property
    def camera_slices(self) -> tuple[slice, ...]:
        """The places of each camera's parameters."""
        counts = [4 + len(self.views[numbers[0]].distortion) for numbers in self.cameras]
        ends = np.cumsum([0, *counts])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def medium_slice(self) -> slice:
        """The places of the medium's numbers."""
        start = int(self.camera_slices[-1].stop)
        return slice(start, start + len(self.medium))

    def pose_slice(self, view: int) -> slice:
        """The places of a view's pose."""
        start = self.medium_slice.stop + 6 * view
        return slice(start, start + 6)

    @property
    def count(self) -> int:
        """P."""
        return int(self.medium_slice.start) + len(self.medium) + 6 * len(self.views)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """(P,) for users."""
        out = []
        for numbers in self.cameras:
            view = self.views[numbers[0]]
            prefix = "+".join(self.views[n].name for n in numbers)
            own = (*CAMERA_NAMES, *NAMES[view.lens][: len(view.distortion)])
            out += [f"{prefix}.{name}" for name in own]
        out += self.medium
        return tuple(out + [f"{view.name}.{name}" for view in self.views for name in POSE_NAMES])

    def values(self, views: tuple[View, ...]) -> Array:
        """(C + medium,) the values of cameras and medium; a pose has none."""
        found: list[float] = []
        for numbers in self.cameras:
            view = views[numbers[0]]
            found += [*view.focal_px, *view.centre_px, *view.distortion]
        return np.array(found + [getattr(views[0].medium, name) for name in self.medium])

    def deviation(self, step: Array, name: str = "") -> Deviation:
        """Offsets (P,) of all unknowns as a deviation of the rig."""
        lens: list[tuple[float, ...]] = [()] * len(self.views)
        for numbers, place in zip(self.cameras, self.camera_slices, strict=True):
            for number in numbers:
                lens[number] = tuple(step[place].tolist())
        offsets = dict(zip(self.medium, step[self.medium_slice].tolist(), strict=True))
        pose = tuple(tuple(step[self.pose_slice(v)].tolist()) for v in range(len(self.views)))
        return Deviation(name, tuple(offsets.get(field, 0.0) for field in MEDIUM_FIELDS), tuple(lens), pose)

    def stated(self, camera_cov: Array | None, medium_deviation: dict[str, float]) -> Array:
        """(P, P) information about the unknowns before the pictures; 0 for poses.

        Args:
            camera_cov: covariance of a camera's parameters; None: as of a camera that was not calibrated.
            medium_deviation: standard deviations of the uncertain numbers.
        """
        out = np.zeros((self.count, self.count))
        for numbers, place in zip(self.cameras, self.camera_slices, strict=True):
            cov = camera_cov if camera_cov is not None else _uncalibrated(self.views[numbers[0]])
            out[place, place] = _inverse(cov)
        for at, name in enumerate(self.medium, self.medium_slice.start):
            out[at, at] = 1 / medium_deviation[name] ** 2
        return out


class Seen(NamedTuple):
    """N points in V views, with derivatives; NaN where a point has no picture.

    Attributes:
        xy_px: (V, N, 2).
        by_point: (V, N, 2, 3).
        by_unknowns: (V, N, 2, P).
    """

    xy_px: Array
    by_point: Array
    by_unknowns: Array


def see(unknowns: Unknowns, views: tuple[View, ...], xyz_mm: Array) -> Seen:
    """The pictures of points (N, 3) mm in placed views."""
    linear = [view.linearised(xyz_mm) for view in views]
    columns = np.zeros((len(views), len(xyz_mm), 2, unknowns.count))
    for numbers, place in zip(unknowns.cameras, unknowns.camera_slices, strict=True):
        for v in numbers:
            columns[v][..., place] = views[v].by_lens(linear[v].directions)
    for v, view in enumerate(views):
        columns[v][..., unknowns.pose_slice(v)] = linear[v].by_pose
        for at, name in enumerate(unknowns.medium, unknowns.medium_slice.start):
            offsets = [MEDIUM_STEP * (field == name) for field in MEDIUM_FIELDS]
            moved = replace(view, medium=deviated_medium(view.medium, offsets)).project(xyz_mm)
            columns[v][..., at] = (moved - linear[v].xy_px) / MEDIUM_STEP
    return Seen(np.stack([one.xy_px for one in linear]), np.stack([one.by_point for one in linear]), columns)


def _uncalibrated(view: View) -> Array:
    focal_px = float(np.mean(view.focal_px))
    own = [TANGENTIAL if name[0] == "p" else RADIAL for name in NAMES[view.lens][: len(view.distortion)]]
    focal, centre = FOCAL_SHARE * focal_px, CENTRE_SHARE * focal_px
    cov = np.diag(np.square([focal, focal, centre, centre, *own]))
    cov[0, 1] = cov[1, 0] = focal**2 * (1 - 1e-4)  # pixels are square to a percent of this deviation
    return cov


def _inverse(cov: Array) -> Array:
    root = np.sqrt(cov.diagonal())
    return np.asarray(np.linalg.inv(cov / root / root[:, None]) / root / root[:, None])
