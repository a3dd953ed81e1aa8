"""A rig from its markers at rest and from steps of a plate, with what remains undetermined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.rig.adjustment import AdjustedRig, RigProblem, RigStep, adjust_rig
from cmpdesign.calibration.rig.mirrors import MirrorPair, mirror_pairs
from cmpdesign.calibration.rig.unknowns import Unknowns
from cmpdesign.errors import CmpDesignError
from extractor import Markers, Reference, Status, View
from extractor.space.camera import is_finite
from extractor.space.pose import estimate_poses
from extractor.space.rig import Deviation, Rig
from extractor.space.triangulation import deviating_moves

Array = NDArray[np.float64]

HELD = 0.5  # deviation after the pictures over the stated one, from which a number counts as not determined; chosen
MIN_PLATE_MARKERS = 20
PRESS_MM = 0.5  # of the displacements that the deviations are made for
MAX_GEL = 0.3  # of the gel's thickness, for the same
EXPLAINED = 0.995  # share of the variance of displacements that the written deviations hold


@dataclass(frozen=True, eq=False)
class RigCalibration:
    """A calibrated rig.

    Attributes:
        rig: the views with lenses, medium and poses, and independent deviations.
        names: P names of the unknowns; the first ones, of lenses and medium, have ``values``.
        values: (P - 6 V,) of lenses and medium.
        stated: (P - 6 V,) their standard deviations before the pictures.
        deviations: (P,) standard deviations after.
        rms_px: view -> RMS residual at rest, px per axis.
        scale: residuals over their stated deviations.
        plate_markers: of each step.
        mirrors: pairs of views behind one camera, and their mirrors.
        depth_share: standard deviation of the depth of a press, over the press, by all that is not determined.
    """

    rig: Rig
    names: tuple[str, ...]
    values: Array
    stated: Array
    deviations: Array
    rms_px: dict[str, float]
    scale: float
    plate_markers: tuple[int, ...]
    mirrors: tuple[MirrorPair, ...]
    depth_share: float

    @property
    def held(self) -> tuple[str, ...]:
        """The numbers of lenses and medium that the pictures do not determine."""
        left = self.deviations[: len(self.stated)] / self.stated
        return tuple(name for name, share in zip(self.names, left, strict=False) if share > HELD)

    def by_name(self) -> dict[str, dict[str, float]]:
        """The values as ``parameters``, and their ``stated`` and later ``deviations``, by the names of the unknowns."""
        return {
            "parameters": dict(zip(self.names, self.values.tolist(), strict=False)),
            "stated": dict(zip(self.names, self.stated.tolist(), strict=False)),
            "deviations": dict(zip(self.names, self.deviations.tolist(), strict=True)),
        }


def calibrate_rig_markers(
    layout: Reference,
    rig: Rig,
    rest: Sequence[Sequence[Markers]],
    steps: Mapping[float, Sequence[Markers]],
    *,
    camera_cov: Array | None = None,
    step_sigma_mm: float = 0.005,
) -> RigCalibration:
    """The rig that took pictures of a pad at rest and below a plate.

    Args:
        layout: the pad's.
        rig: lenses, and medium with its deviations; poses are estimated anew.
        rest: the markers of one or more pictures at rest, view by view.
        steps: ways of the plate in mm -> markers, view by view.
        camera_cov: covariance of the cameras' parameters, in the order fx, fy, cx, cy, coefficients; None: cameras
            that were not calibrated.
        step_sigma_mm: standard deviation of a way.

    Raises:
        CmpDesignError: too few markers below the plate, or a covariance of another lens.
        PoseError: markers at rest that fix no pose.
    """
    start = replace(rig, deviations=()).without_poses()
    flat_mm = np.column_stack([layout.xy_mm, np.zeros(len(layout.xy_mm))])
    at_rest = mean_of([as_step(one, 0.0) for one in rest])
    poses = estimate_poses(start.views, layout.xy_mm, at_rest.xy_px, at_rest.cov_px2, (0.0, 0.0, 0.0))
    at_rest = at_rest._replace(xy_px=np.where(poses.used[:, None], at_rest.xy_px, np.nan))
    unknowns = Unknowns(poses.views, tuple(rig.medium_deviation))
    _require_covariance(camera_cov, unknowns)
    stated = unknowns.stated(camera_cov, dict(rig.medium_deviation))
    pressed = tuple(as_step(found, press_mm) for press_mm, found in steps.items())
    problem = RigProblem(unknowns, stated, flat_mm, at_rest, pressed, step_sigma_mm)
    found = adjust_rig(problem, poses.views)
    _require_plate(problem, found)
    return _summary(problem, found, rig)


def as_step(markers: Sequence[Markers], press_mm: float) -> RigStep:
    """The measured markers of a picture, view by view."""
    measured = [np.where((m.status == Status.MEASURED)[:, None], m.xy_px, np.nan) for m in markers]
    return RigStep(press_mm, np.stack(measured), np.stack([m.cov_px2 for m in markers]))


def mean_of(pictures: Sequence[RigStep]) -> RigStep:
    """Means of the markers over pictures at rest, weighted by information."""
    if len(pictures) == 1:
        return pictures[0]
    weights = []
    for one in pictures:
        known = is_finite(one.xy_px) & is_finite(one.cov_px2, 2)
        cov = np.where(known[..., None, None], one.cov_px2, np.eye(2))
        weights.append(np.where(known[..., None, None], np.linalg.inv(cov), 0.0))
    total = np.sum(weights, axis=0)
    seen = total[..., 0, 0] > 0
    cov = np.where(
        seen[..., None, None], np.linalg.inv(np.where(seen[..., None, None], total, np.eye(2))), np.nan
    )
    pulled = sum(w @ np.nan_to_num(one.xy_px)[..., None] for w, one in zip(weights, pictures, strict=True))
    return RigStep(0.0, np.where(seen[..., None], (cov @ pulled)[..., 0], np.nan), cov)


def _require_covariance(camera_cov: Array | None, unknowns: Unknowns) -> None:
    for numbers, place in zip(unknowns.cameras, unknowns.camera_slices, strict=True):
        if camera_cov is not None and len(camera_cov) != place.stop - place.start:
            raise CmpDesignError(
                f"[calibration.camera] has a covariance of {len(camera_cov)} parameters, view "
                f"{unknowns.views[numbers[0]].name!r} has {place.stop - place.start}; copy the view's lens from the "
                "same camera file"
            )


def _require_plate(problem: RigProblem, found: AdjustedRig) -> None:
    for step, markers in zip(problem.steps, found.on_plate, strict=True):
        if markers.sum() < MIN_PLATE_MARKERS:
            raise CmpDesignError(
                f"step {step.press_mm:g} mm: {int(markers.sum())} markers lie on a plane, expected "
                f"{MIN_PLATE_MARKERS}; press with a flat plate that is larger than the pattern"
            )


def _summary(problem: RigProblem, found: AdjustedRig, rig: Rig) -> RigCalibration:
    unknowns, count = problem.unknowns, len(rig.views)
    first = unknowns.medium_slice.stop
    deviations = np.sqrt(found.cov.diagonal())
    medium_deviation = dict(zip(unknowns.medium, deviations[unknowns.medium_slice].tolist(), strict=True))
    modes = _independent(problem, found)
    stated = np.sqrt(np.linalg.inv(problem.stated[:first, :first]).diagonal())
    rms = np.sqrt(np.nanmean(found.rest_px**2, axis=(1, 2)))
    return RigCalibration(
        rig=Rig(found.views, medium_deviation, modes),
        names=unknowns.names,
        values=unknowns.values(found.views),
        stated=stated,
        deviations=deviations,
        rms_px=dict(zip(rig.names, rms.tolist(), strict=True)),
        scale=found.scale,
        plate_markers=tuple(int(one.sum()) for one in found.on_plate),
        mirrors=mirror_pairs(unknowns, found.views) if count > 1 else (),
        depth_share=_depth_share(problem, found.views, modes),
    )


def misread_displacements(
    rest_mm: Array, cov_px2: Array, views: Sequence[View], deviating: Sequence[Sequence[View]]
) -> Array:
    """(K, 3, M, 3) mm by which displacements of ``PRESS_MM`` along -z, x and y are read wrong, if K others are true."""
    press_mm = press_of(views)
    moved = [deviating_moves(views, deviating, rest_mm, cov_px2)]
    for axis in (-np.eye(3)[2], np.eye(3)[0], np.eye(3)[1]):
        moved.append(deviating_moves(views, deviating, rest_mm + press_mm * axis, cov_px2))
    return np.stack([one - moved[0] for one in moved[1:]], axis=1)


def press_of(views: Sequence[View]) -> float:
    """``PRESS_MM``, or less where the gel is thin."""
    medium = views[0].medium
    return PRESS_MM if medium is None or not medium.gel_mm else min(PRESS_MM, MAX_GEL * medium.gel_mm)


def _depth_share(problem: RigProblem, views: Sequence[View], modes: Sequence[Deviation]) -> float:
    if not modes:
        return 0.0
    deviating = [one.applied(views) for one in modes]
    read = misread_displacements(problem.rest_mm, problem.rest.cov_px2, views, deviating)[:, 0, :, 2]
    return float(np.sqrt(np.nanmean((read**2).sum(axis=0))) / press_of(views))


def _independent(problem: RigProblem, found: AdjustedRig) -> tuple[Deviation, ...]:
    """Independent deviations of all unknowns, as many as displacements need."""
    unknowns, sigma = problem.unknowns, np.sqrt(found.cov.diagonal())
    values, vectors = np.linalg.eigh(found.cov / sigma / sigma[:, None])
    roots = (vectors * np.sqrt(np.maximum(values, 0.0))) * sigma[:, None]  # (P, P), columns
    variants = [unknowns.deviation(column).applied(found.views) for column in roots.T]
    effects = misread_displacements(problem.rest_mm, problem.rest.cov_px2, found.views, variants)
    effects = effects.reshape(len(variants), -1)
    effects = effects[:, np.isfinite(effects).all(axis=0)]
    left, strength, _ = np.linalg.svd(effects, full_matrices=False)
    total = np.cumsum(strength**2)
    if not len(total) or not total[-1]:
        return ()
    needed = int(np.searchsorted(total, EXPLAINED * total[-1])) + 1
    modes = roots @ left[:, :needed]
    return tuple(
        unknowns.deviation(mode, unknowns.names[int(np.abs(mode / sigma).argmax())]) for mode in modes.T
    )
