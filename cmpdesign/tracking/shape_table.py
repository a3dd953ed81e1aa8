"""The table of reconstruction: the surface of every frame, with the column names of Tac3D."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmpdesign.tracking.columns import (
    COVARIANCE,
    UPPER,
    Columns,
    by_point,
    head_columns,
    long_head_columns,
    time_columns,
    unknown_times,
)
from cmpdesign.tracking.force_table import FORCE_DIGITS, force_about, force_columns, force_long_form
from cmpdesign.tracking.sources.frame_source import SourceTimes

if TYPE_CHECKING:
    from cmpdesign.contact.continuation import SurfaceContinuation
    from extractor.contact import ContactReader
    from extractor.space.reconstruction import Reconstructor, Shape
    from extractor.space.views import ShapeFrame

TRIPLES = {
    "3D_Positions": ("x_mm", "y_mm", "z_mm"),
    "3D_Displacements": ("dx_mm", "dy_mm", "dz_mm"),
    "3D_Normals": ("nx", "ny", "nz"),
}
SURFACE = ("surface_dx_mm", "surface_dy_mm", "surface_dz_mm")  # of the touched surface above the markers


class ShapeTable:
    """The table of a reconstructor's frames: F frames by N points, first the M markers, then the virtual markers.

    Args:
        reconstructor: its layout, poses and rest frame are the shared columns.
        continuation: continues the markers' displacements to the touched surface, for further columns; None: not
            wanted.
        times: gives how the frames' times were found, for the shared columns.
        contact: the reader whose forces the frames hold, for further columns; None: frames without forces.
    """

    _digits: Mapping[str, int] = (
        {name: 0 for name in ("point", "edge", "status", "point_reason")}
        | {name: 6 for name in (*TRIPLES["3D_Positions"], *TRIPLES["3D_Displacements"])}
        | {name: 7 for name in TRIPLES["3D_Normals"]}
        | {f"cov_{name}_mm2": 12 for name in COVARIANCE}
    )

    _surface_digits: Mapping[str, int] = {name: 6 for name in SURFACE} | {
        f"surface_cov_{name}_mm2": 12 for name in COVARIANCE
    }

    def __init__(
        self,
        reconstructor: Reconstructor,
        continuation: SurfaceContinuation | None = None,
        times: Callable[[], SourceTimes] = unknown_times,
        contact: ContactReader | None = None,
    ) -> None:
        self._reconstructor, self._continuation, self._times = reconstructor, continuation, times
        self._contact = contact
        self.digits: Mapping[str, int] = (
            dict(self._digits) if continuation is None else {**self._digits, **self._surface_digits}
        )
        if contact is not None:
            self.digits = {**self.digits, **FORCE_DIGITS}

    def batch(self, frames: Sequence[ShapeFrame]) -> Columns:
        shapes = [frame.shape for frame in frames]
        columns = head_columns(frames)
        columns["status"] = np.stack([_join_virtual(s.status, s.virtual_status) for s in shapes])
        columns["point_reason"] = np.stack([_reason_texts(s) for s in shapes])
        columns["misfit"] = np.stack([s.misfit for s in shapes]).astype(np.float32)
        for name in TRIPLES:
            columns[name] = np.stack([s.tac3d[name] for s in shapes]).astype(np.float32)
        cov = np.stack([np.concatenate([s.cov_mm2, s.virtual_cov_mm2.reshape(-1, 3, 3)]) for s in shapes])
        columns["cov_mm2"] = cov[:, :, UPPER[0], UPPER[1]].astype(np.float32)
        if self._continuation is not None:
            surfaces = [self._continuation(s.displacement_mm, s.displacement_cov_mm2) for s in shapes]
            moved = np.stack([surface.displacement_mm for surface in surfaces])
            spread = np.stack([surface.cov_mm2[:, UPPER[0], UPPER[1]] for surface in surfaces])
            columns["surface_displacement_mm"] = moved.astype(np.float32)
            columns["surface_cov_mm2"] = spread.astype(np.float32)
        if self._contact is not None:
            columns |= force_columns([frame.contact for frame in frames if frame.contact is not None])
        return columns

    def about(self) -> Columns:
        """The layout, the poses of the views, and the surface at rest."""
        reconstructor = self._reconstructor
        layout, poses = reconstructor.layout, reconstructor.poses
        markers, count = len(layout.layer), layout.virtual_per_edge
        edge = np.concatenate([np.full(markers, -1), np.repeat(np.arange(len(layout.edges)), count)])
        return {
            "format": np.array("cmp-reconstruction"),
            "digest": np.array(layout.digest),
            "layer": layout.layer,
            "index": layout.index,
            "layout_xy_mm": layout.xy_mm,
            "edges": layout.edges,
            "edge": edge.astype(np.int32),
            "rest_positions_mm": reconstructor.rest_positions_mm,
            "views": np.array([view.name for view in poses.views]),
            "R_camera_from_layout": np.stack([view.R_camera_from_layout for view in poses.views]),
            "t_camera_from_layout_mm": np.stack([view.t_camera_from_layout_mm for view in poses.views]),
            "pose_rms_px": poses.rms_px,
            "pose_misfit": np.array(poses.misfit),
            "model_px": np.array(reconstructor.model_px),
            **time_columns(self._times()),
            **({} if self._contact is None else force_about(self._contact)),
        }


def _join_virtual(status: np.ndarray, virtual: np.ndarray) -> np.ndarray:
    return np.concatenate([status, virtual.ravel()])


def _reason_texts(shape: Shape) -> np.ndarray:
    from extractor import PointReason

    lost = shape.virtual_status.ravel() == 0
    return np.concatenate([shape.reason, np.where(lost, PointReason.SURROUNDINGS, 0).astype(np.uint8)])


def shape_long_form(columns: Columns, fixed: Columns) -> Columns:
    """The long form: one row for every frame and point (also lost points), one column per axis of a triple."""
    frames, count = columns["status"].shape
    long = long_head_columns(columns, count)
    long["point"] = np.tile(np.arange(count, dtype=np.int32), frames)
    long["edge"] = np.tile(fixed["edge"], frames)
    long["status"], long["point_reason"] = columns["status"].reshape(-1), columns["point_reason"].reshape(-1)
    for name, axes in TRIPLES.items():
        for place, axis in enumerate(axes):
            long[axis] = columns[name][..., place].reshape(-1)
    for place, name in enumerate(COVARIANCE):
        long[f"cov_{name}_mm2"] = columns["cov_mm2"][..., place].reshape(-1)
    if "surface_displacement_mm" in columns:
        for place, axis in enumerate(SURFACE):
            long[axis] = by_point(columns["surface_displacement_mm"][..., place], count)
        for place, name in enumerate(COVARIANCE):
            long[f"surface_cov_{name}_mm2"] = by_point(columns["surface_cov_mm2"][..., place], count)
    if "force_n" in columns:
        long |= force_long_form(columns, count)
    return long
