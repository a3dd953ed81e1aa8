"""From the markers of two or more views to the surface in space: positions, displacements, normals, covariances.

All results are in mm of the layout frame: x right, y up, z out of the front. The views' poses are estimated once, from
the markers at rest; each frame is then reconstructed independently, so there is no drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import space as native
from extractor.errors import PoseError
from extractor.frozen_record import LateRecord
from extractor.layout.layout_file import LayoutLike, layout_of
from extractor.result import SIDE_REASONS, Markers, Status
from extractor.space.camera import Array, View, is_finite
from extractor.space.field import Field, normals_of
from extractor.space.pose import Poses, estimate_poses
from extractor.space.rig import Rig
from extractor.space.triangulation import (
    GATE_SIGMAS,
    PointReason,
    Points,
    deviating_moves,
    triangulate,
)

MAX_DEVIATION_EDGES = 0.1  # standard deviation of a position above which it is not reported, in edges; chosen
NEIGHBOURHOOD_SIGMAS = 1.4  # RMS misfit of two rings of markers above which covariances are inflated; chosen
MIN_REST_MARKERS = 3  # markers that must have a position at rest; derived: a plane
SURFACE = (  # attributes of Shape that need the surface's gradients
    "normals",
    "virtual_xyz_mm",
    "virtual_cov_mm2",
    "virtual_displacement_mm",
    "virtual_normals",
    "virtual_status",
)


class SurfaceMarkers(NamedTuple):
    """M markers on a surface: their places, covariances, gradients (M, 3, 2) and normals, as in ``Shape``."""

    xyz_mm: Array
    cov_mm2: Array
    slopes: Array
    normals: Array


class SurfacePoints(NamedTuple):
    """The virtual markers of a surface, as in ``Shape``."""

    xyz_mm: Array
    cov_mm2: Array
    normals: Array
    status: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Shape(LateRecord):
    """The surface in one frame, in mm of the layout frame; NaN where unknown. Can be pickled and copied.

    A reconstructor's result computes normals and virtual markers, the covariances of displacements, and their
    systematic part when they are first asked for.

    Attributes:
        xyz_mm: (M, 3) float64, the markers by id.
        cov_mm2: (M, 3, 3) float64, of the pixels' noise, of the error of the camera model, and of the poses. The last
            part is common to all markers.
        displacement_mm: (M, 3) float64, from the rest frame.
        displacement_cov_mm2: (M, 3, 3) float64; errors of the poses that both frames share cancel.
        normals: (M, 3) float64, unit vectors out of the front.
        status: (M,) uint8, a ``Status`` each: the weakest status of the views.
        reason: (M,) uint8, a ``PointReason`` each: why a marker has no position.
        misfit: (M,) float64, the distance by which the rays miss each other, in standard deviations; also of markers
            that are not reported for this reason.
        virtual_xyz_mm, virtual_displacement_mm, virtual_normals: (E, m, 3) float64, on the smooth surface through
            the markers, by edge from its smaller id.
        virtual_cov_mm2: (E, m, 3, 3) float64.
        virtual_status: (E, m) uint8, a ``VirtualStatus`` each.
        displacement_systematic_mm: (M, 3) float64, standard deviations of the displacements that follow from the rig's
            deviations, the same error in all frames; not in the covariances. 0 where the rig is exact.
        problem: the views without a pattern, and why; empty where all views show the pattern.
    """

    xyz_mm: Array
    cov_mm2: Array
    displacement_mm: Array
    displacement_cov_mm2: Array
    normals: Array
    status: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    misfit: Array
    virtual_xyz_mm: Array
    virtual_cov_mm2: Array
    virtual_displacement_mm: Array
    virtual_normals: Array
    virtual_status: NDArray[np.uint8]
    displacement_systematic_mm: Array
    problem: str = ""

    @property
    def tac3d(self) -> dict[str, Array]:
        """``3D_Positions``, ``3D_Displacements``, ``3D_Normals``: (M + E m, 3) each, the virtual markers last."""
        pairs = {
            "3D_Positions": (self.xyz_mm, self.virtual_xyz_mm),
            "3D_Displacements": (self.displacement_mm, self.virtual_displacement_mm),
            "3D_Normals": (self.normals, self.virtual_normals),
        }
        return {
            name: np.concatenate([real, virtual.reshape(-1, 3)]) for name, (real, virtual) in pairs.items()
        }


class Reconstructor:
    """Reconstructs a ``Shape`` from each frame's markers. Can be pickled and copied.

    >>> from extractor import Reconstructor, ViewExtractor, load_layout, load_rig
    >>> views = ViewExtractor(load_layout("layout.json"), load_rig("rig.toml"))  # doctest: +SKIP
    >>> reconstructor = Reconstructor(views.layout, views.rig, views.extract(rest_image))  # doctest: +SKIP
    >>> shape = reconstructor.reconstruct(views.extract(image))  # doctest: +SKIP

    Args:
        layout: any pattern.
        rig: two views or more; poses that are not given are estimated from the markers at rest.
        rest: the markers at rest, view by view; None: all poses are the rig's, and displacement is measured from the
            layout's plane.
        flatness_mm: standard deviation of the markers at rest around the layout, one number or (x, y, z). 0: the
            pattern at rest is the layout. Otherwise the poses are estimated jointly, and a dome stays a dome.
        model_px: error of the camera model, as a standard deviation per axis that is added to the pixels' own; None:
            estimated from the misfit of the rest frame's rays beyond their covariances.
        gate_sigmas: misfit above which a marker is not reported.
        max_sigma_mm: standard deviation of a position above which it is not reported; None: a tenth of an edge.

    Attributes:
        poses: the views with their poses, see ``Poses``.
        rest_xyz_mm: (M, 3) float64, the markers at rest.
        warnings: reasons to doubt the results: markers at rest that contradict the rig.

    Raises:
        PoseError: fewer than two views, a view whose pose cannot be estimated, or views that give no depth.
        RigError: the rig was calibrated with another pad.
    """

    def __init__(
        self,
        layout: LayoutLike,
        rig: Rig,
        rest: Sequence[Markers] | None,
        *,
        flatness_mm: float | tuple[float, float, float] = 0.0,
        model_px: float | None = None,
        gate_sigmas: float = GATE_SIGMAS,
        max_sigma_mm: float | None = None,
    ) -> None:
        if len(rig.views) < 2:
            raise PoseError(f"the rig has {len(rig.views)} view; depth needs two or more")
        self.layout = layout = layout_of(layout)
        rig.require_layout(layout)
        self.rig = rig
        self.field = Field(layout)
        edge_mm = np.linalg.norm(np.diff(layout.xy_mm[layout.edges], axis=1)[:, 0], axis=1)
        self._max_sigma_mm = (
            MAX_DEVIATION_EDGES * float(np.median(edge_mm)) if max_sigma_mm is None else max_sigma_mm
        )
        self._gate_sigmas = gate_sigmas
        spread = np.broadcast_to(np.asarray(flatness_mm, np.float64), 3)
        spread_mm = (float(spread[0]), float(spread[1]), float(spread[2]))
        self.poses = self._estimate_poses(rig.views, rest, spread_mm)
        self._deviating = [
            self._estimate_poses(one.applied(rig.views), rest, spread_mm).views
            for one in rig.independent_deviations
        ]
        self.warnings = (self.poses.warning,) if self.poses.warning else ()
        self.model_px = 0.0 if model_px is None else model_px
        flat = np.column_stack([layout.xy_mm, np.zeros(len(layout.xy_mm))])
        self._rest: Points | None = None
        self.rest_xyz_mm: Array = flat
        if rest is not None:
            if model_px is None:
                self.model_px = self._estimate_model_px(rest)
            self._rest = self._points(rest)
            self._require_depth(rest, self._rest)
            self.rest_xyz_mm = self._rest.xyz_mm
        self._rest_moves_mm: Array = (
            self._moves(rest, self.rest_xyz_mm)
            if rest is not None
            else np.zeros((len(self._deviating), *flat.shape))
        )
        slopes, exact = self.field.gradients(self.rest_xyz_mm), np.zeros((len(flat), 3, 3))
        at_rest = SurfaceMarkers(self.rest_xyz_mm, exact, slopes, normals_of(slopes))
        self._rest_virtual_mm = self._virtual(at_rest).xyz_mm

    def reconstruct(self, markers: Sequence[Markers | None]) -> Shape:
        """The surface that the views show; a view without a pattern raises no error.

        Args:
            markers: view by view, in the rig's order and the frame of the full image; None: no image.
        """
        kept, problem = self._select_views(markers)
        points = self._inflated_covariances(self._points(kept))
        by_view = [
            np.where(_has_position(m), m.status, 0) if m is not None else np.zeros_like(points.reason)
            for m in kept
        ]
        status = np.max(by_view, axis=0)
        status = np.where(points.reason == PointReason.NONE, status, Status.LOST).astype(np.uint8)
        cov_mm2 = points.cov_mm2 + _propagate_covariance(points.by_pose, self.poses.cov)

        def surface() -> tuple[NDArray[Any], ...]:
            slopes = self.field.gradients(points.xyz_mm)
            normals = normals_of(slopes)
            found = self._virtual(SurfaceMarkers(points.xyz_mm, cov_mm2, slopes, normals))
            moved_mm = found.xyz_mm - self._rest_virtual_mm
            return normals, found.xyz_mm, found.cov_mm2, moved_mm, found.normals, found.status

        return Shape.with_later(
            {
                SURFACE: surface,
                ("displacement_cov_mm2",): lambda: [self._displacement_cov(points, cov_mm2)],
                ("displacement_systematic_mm",): lambda: [self._systematic_mm(kept, points.xyz_mm)],
            },
            xyz_mm=points.xyz_mm,
            cov_mm2=cov_mm2,
            displacement_mm=points.xyz_mm - self.rest_xyz_mm,
            status=status,
            reason=points.reason,
            misfit=points.misfit,
            problem=problem,
        )

    @property
    def rest_positions_mm(self) -> Array:
        """(M + E m, 3) float64, the positions of all points at rest, the virtual markers last."""
        return np.concatenate([self.rest_xyz_mm, self._rest_virtual_mm.reshape(-1, 3)])

    def _systematic_mm(self, markers: Sequence[Markers | None], xyz_mm: Array) -> Array:
        """(M, 3) the standard deviations of the displacements by all deviations of the rig together."""
        moved = self._moves(markers, xyz_mm) - self._rest_moves_mm
        return np.asarray(np.where(np.isfinite(xyz_mm), np.sqrt((moved**2).sum(axis=0)), np.nan))

    def _moves(self, markers: Sequence[Markers | None], xyz_mm: Array) -> Array:
        """(K, M, 3) mm by which positions (M, 3) move with each deviation of the rig."""
        model_cov, unseen = np.eye(2) * self.model_px**2, np.full((len(xyz_mm), 2, 2), np.nan)
        cov = [
            unseen if m is None else np.where(_has_position(m)[:, None, None], m.cov_px2 + model_cov, np.nan)
            for m in markers
        ]
        return deviating_moves(self.poses.views, self._deviating, xyz_mm, np.stack(cov))

    def _estimate_poses(
        self, views: Sequence[View], rest: Sequence[Markers] | None, spread_mm: tuple[float, float, float]
    ) -> Poses:
        if rest is None:
            missing = [view.name for view in views if not view.placed]
            if missing:
                raise PoseError(f"view {missing[0]!r} has no pose; give its R and t, or markers at rest")
            none = np.zeros(len(self.layout.xy_mm), np.bool_)
            cov = np.zeros((6 * len(views), 6 * len(views)))
            return Poses(tuple(views), cov, float("nan"), np.full(len(views), np.nan), none)
        self._require_count(rest)
        for view, markers in zip(views, rest, strict=True):
            if markers.reason in SIDE_REASONS:
                raise PoseError(
                    f"view {view.name!r} shows the pattern's other side at rest ({markers.reason}); check which "
                    "views are mirrored, and state side or channels"
                )
            if not markers.found:
                raise PoseError(
                    f"view {view.name!r} shows no pattern at rest ({markers.reason}); choose another frame"
                )
        measured = [np.where((m.status == Status.MEASURED)[:, None], m.xy_px, np.nan) for m in rest]
        cov = np.stack([m.cov_px2 for m in rest])
        poses = estimate_poses(views, self.layout.xy_mm, np.stack(measured), cov, spread_mm)
        for view, markers in zip(poses.views, rest, strict=True):
            if markers.mirrored is not None and markers.mirrored != appears_mirrored(view):
                raise PoseError(
                    f"view {view.name!r}: its pose faces the other side of the pattern than the rest frame shows; "
                    "check R_camera_from_layout and mirrored"
                )
        return poses

    def _require_count(self, markers: Sequence[Markers | None]) -> None:
        if len(markers) != len(self.rig.views):
            raise ValueError(f"markers of {len(markers)} views; the rig has {len(self.rig.views)}")

    def _require_depth(self, rest: Sequence[Markers], points: Points) -> None:
        if np.isfinite(points.xyz_mm[:, 0]).sum() >= MIN_REST_MARKERS:
            return
        both = np.logical_and.reduce([_has_position(markers) for markers in rest])
        reasons = np.bincount(points.reason[both], minlength=len(PointReason)) if both.any() else np.zeros(1)
        why = PointReason(int(reasons.argmax())) if both.any() else PointReason.ONE_VIEW
        names = " and ".join(repr(view.name) for view in self.rig.views)
        texts = {
            PointReason.PARALLEL: "stand too near to each other to measure depth: a position's standard deviation "
            "would "
            f"exceed {self._max_sigma_mm:.3g} mm",
            PointReason.DISAGREE: "contradict each other at rest; check their intrinsics and which are mirrored",
            PointReason.ONE_VIEW: "show no marker in common",
            PointReason.NO_RAY: "have markers where the distortion has no inverse; check it",
        }
        raise PoseError(f"views {names} {texts.get(why, 'show no marker in common')}")

    def _select_views(self, markers: Sequence[Markers | None]) -> tuple[list[Markers | None], str]:
        """The markers of the views that show the pattern's side that their pose faces, and the others' problems."""
        self._require_count(markers)
        kept: list[Markers | None] = []
        problems = []
        for view, found in zip(self.poses.views, markers, strict=True):
            problem = ""
            if found is None:
                problem = "no picture"
            elif not found.found:
                problem = str(found.reason)
            elif found.mirrored is not None and found.mirrored != appears_mirrored(view):
                problem = "shows the pattern's other side"
            kept.append(None if problem else found)
            if problem:
                problems.append(f"{view.name}: {problem}")
        return kept, "; ".join(problems)

    def _points(self, markers: Sequence[Markers | None], model_px: float | None = None) -> Points:
        """The triangulated markers; with ``model_px``, this is the camera model's error and no misfit is rejected."""
        count = len(self.layout.xy_mm)
        model_cov = np.eye(2) * (self.model_px if model_px is None else model_px) ** 2
        xy = [np.full((count, 2), np.nan) if m is None else m.xy_px for m in markers]
        cov = [np.full((count, 2, 2), np.nan) if m is None else m.cov_px2 + model_cov for m in markers]
        return triangulate(
            self.poses.views,
            np.stack(xy),
            np.stack(cov),
            cov_pose=self.poses.cov,
            max_sigma_mm=self._max_sigma_mm,
            gate_sigmas=self._gate_sigmas if model_px is None else np.inf,
        )

    def _inflated_covariances(self, points: Points) -> Points:
        """The points with larger covariances where the rays of a whole neighbourhood miss each other.

        Under a sharp contact, gridlines bend more than extraction can follow, and its covariances are too small.
        """
        nearby = self.field.mean_around(points.misfit**2)
        wanted = np.where(nearby > NEIGHBOURHOOD_SIGMAS**2, nearby, 1.0)
        factor = np.where(np.isfinite(wanted), np.maximum(wanted / points.inflation, 1.0), 1.0)
        return replace(points, cov_mm2=points.cov_mm2 * factor[:, None, None])

    def _estimate_model_px(self, rest: Sequence[Markers]) -> float:
        """The misfit of the rest frame's rays beyond their covariances, px per axis, without outliers."""
        misfit = self._points(rest, 0.0).misfit
        misfit = misfit[np.isfinite(misfit)]
        if len(misfit) < MIN_REST_MARKERS:
            return 0.0
        inliers = misfit[misfit <= GATE_SIGMAS * np.median(misfit)]
        variance = np.mean([np.nanmedian(np.trace(m.cov_px2, axis1=1, axis2=2)) / 2 for m in rest])
        return float(np.sqrt(max(0.0, np.mean(inliers**2) - 1) * variance))

    def _displacement_cov(self, points: Points, cov_mm2: Array) -> Array:
        if self._rest is None:
            return cov_mm2
        moved = points.by_pose - self._rest.by_pose
        return points.cov_mm2 + self._rest.cov_mm2 + _propagate_covariance(moved, self.poses.cov)

    def _virtual(self, markers: SurfaceMarkers) -> SurfacePoints:
        """The virtual markers on the smooth surface; where too few neighbours are known, the chord is the slope."""
        start, end = self.layout.edges.T
        steps_mm = self.layout.xy_mm[end] - self.layout.xy_mm[start]
        return native.points_on_edges(markers, self.layout.edges, steps_mm, self.layout.virtual_per_edge)


def _has_position(markers: Markers) -> NDArray[np.bool_]:
    return is_finite(markers.xy_px)


def appears_mirrored(view: View) -> bool:
    """Whether the picture of the pattern is mirrored: it shows the back directly, or the front through a mirror."""
    return bool(np.linalg.det(view.R_camera_from_layout) * view.position_mm[2] < 0)


def _propagate_covariance(by_pose: Array, cov: Array) -> Array:
    """(N, 3, 3) covariances J C J^T for derivatives J (N, 3, 6 V) and the poses' covariance C (6 V, 6 V)."""
    weighted = (by_pose.reshape(-1, len(cov)) @ cov).reshape(by_pose.shape)
    return np.asarray(weighted @ np.swapaxes(by_pose, 1, 2))
