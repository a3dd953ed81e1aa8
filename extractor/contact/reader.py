"""From the displacement of the markers to force, torque and regions."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from extractor.contact.active_set import LIMITS, Solution, TractionSolver, times
from extractor.contact.gel import Gel
from extractor.contact.regions import AREA_ERROR, HERTZ, Patch, find_patches
from extractor.contact.result import ContactForce, ContactReason, Region
from extractor.errors import GelError
from extractor.layout.layout_file import LayoutLike, layout_of

Array = NDArray[np.float64]


class Displaced(Protocol):
    """Displacements (M, 3) mm with covariances (M, 3, 3) mm^2, as of a ``Shape``."""

    @property
    def displacement_mm(self) -> Array: ...

    @property
    def displacement_cov_mm2(self) -> Array: ...


@dataclass(frozen=True)
class ForceModel:
    """What the linear model of a gel is worth.

    Attributes:
        strain_factor, strain_sigma: the normal force of a region of radius a on a gel of thickness h is the linear one
            times 1 + ``strain_factor`` (a / h) (F / (A E))^2; and the factor's deviation. Measured:
            python -m benchmarks.force, by the half of its contacts that is named so.
        narrow_error: the same force's deviation, as a share, where a contact's radius is one spacing of loads; it falls
            with the radius' square. Measured: the same command.
        noise_sideways, noise_upright: factors of the noise's deviation in x and y, and in z, because the support is
            estimated too. Measured: the same command.
        normal_error, shear_error, torque_error: the model's own deviation, as a share: of the normal force, of the
            shear, and of the torque about the centre of pressure. Measured: the same command.
        shear_by_press: the same of the shear, as a share of the normal force. Measured: the same command.
        centre_error: the same of the force's place, as a share of the contact's radius. Measured: the same command.
        centre_by_shear: the same of the centre, times shear over press. Measured: the same command.
        largest_load: F / (A E) above which the frame has a reason. Measured: python -m benchmarks.force.stiffening,
            whose states end there.
        fewest_known: share of the markers that must have a displacement. Chosen.
        rim_spacings: distance of the pressure to the gel's rim, in spacings of loads, below which the frame has a
            reason. Chosen.
    """

    strain_factor: float = 0.7
    strain_sigma: float = 0.2
    narrow_error: float = 0.05
    noise_sideways: float = 1.3
    noise_upright: float = 2.2
    normal_error: float = 0.015
    shear_error: float = 0.025
    torque_error: float = 0.03
    shear_by_press: float = 0.002
    centre_error: float = 0.008
    centre_by_shear: float = 0.05
    largest_load: float = 0.65
    fewest_known: float = 0.5
    rim_spacings: float = 2.0


MODEL = ForceModel()
# In one image a large strain does not make the force too small: python -m benchmarks.force.stiffening --one-view 60.
ONE_VIEW = replace(MODEL, strain_factor=0.0)
# One image tells less of the pressure than two: beyond the model's range a narrower prior would change the force.
ONE_VIEW_LIMITS = replace(LIMITS, tau=0.5)
SMOOTH_SPACINGS = 0.8  # width of the smoothed loads; chosen
MIN_SIGMAS = 3.0  # of the force, below which it is too little


class ContactReader:
    """Reads the contact from displacements, frame after frame. Can be pickled and copied.

    A frame starts from the support of the frame before; ``reset`` forgets it.

    Args:
        layout: the pad.
        gel: its Green's matrix, see ``load_gel``.
        young_mpa: Young's modulus; forces are proportional to it.
        young_sigma_mpa: deviation of the modulus; it is part of every covariance.
        about_mm: the point of the torque, in the layout frame; z = 0 is the touched face at rest.
        friction: coefficient of friction for the utilisation; None: not known.
        model: what the linear model is worth.

    Raises:
        GelError: the gel is another pad's, or the modulus is missing or not positive.
    """

    def __init__(
        self,
        layout: LayoutLike,
        gel: Gel,
        young_mpa: float,
        *,
        young_sigma_mpa: float = 0.0,
        about_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
        friction: float | None = None,
        model: ForceModel = MODEL,
    ) -> None:
        self.layout = layout_of(layout)
        gel.require_layout(self.layout)
        if young_mpa is None or not np.isfinite(young_mpa) or young_mpa <= 0:
            raise GelError(
                f"young_mpa is {young_mpa}; forces need Young's modulus above 0 MPa: cmpdesign calibrate force"
            )
        self.gel, self.young_mpa, self.friction, self.model = gel, float(young_mpa), friction, model
        self.young_share = float(young_sigma_mpa) / self.young_mpa
        self.about_mm = np.asarray(about_mm, np.float64)
        self._axes, self._solver = 3, TractionSolver(gel)
        self._rim_mm = _distance_inside(gel.outline_mm, gel.loads_mm)
        self._support: NDArray[np.intp] | None = None

    def seen(self, by_displacement: Array, model: ForceModel = ONE_VIEW) -> ContactReader:
        """A reader of other measured numbers than displacements in space: of those in one image.

        Args:
            by_displacement: (M, C, 3) derivatives of a marker's C measured numbers by its displacement in mm.
            model: what the linear model is worth for these numbers.
        """
        other = copy(self)
        other.model = model
        other._axes = by_displacement.shape[1]
        other._solver = TractionSolver(self.gel, by_displacement, ONE_VIEW_LIMITS)
        other.reset()
        return other

    def reset(self) -> None:
        """Forget the frame before."""
        self._support = None

    def read_shape(self, shape: Displaced) -> ContactForce:
        """The contact of a reconstructed surface."""
        return self.read(shape.displacement_mm, shape.displacement_cov_mm2)

    def read(self, displacement: Array, cov: Array) -> ContactForce:
        """The contact from displacements (M, 3) mm with covariances (M, 3, 3) mm^2; NaN where unknown.

        A reader made by ``seen`` reads C numbers a marker in their own units.

        Raises:
            ValueError: another shape, or displacements without covariances.
        """
        count, axes = len(self.layout.xy_mm), self._axes
        if np.shape(displacement) != (count, axes) or np.shape(cov) != (count, axes, axes):
            raise ValueError(
                f"displacement {np.shape(displacement)} and cov {np.shape(cov)}; expected ({count}, {axes}) and "
                f"({count}, {axes}, {axes}): one displacement and its covariance for every marker"
            )
        known = np.asarray(
            np.isfinite(displacement).all(axis=1) & np.isfinite(cov).all(axis=(1, 2)), np.bool_
        )
        present = max(int(self.layout.present.sum()), 1)
        if known.sum() < self.model.fewest_known * present:
            self._support = None
            return self._without(ContactReason.TOO_FEW_MARKERS, np.nan)
        whitening = np.zeros((count, axes, axes))
        try:
            whitening[known] = np.linalg.inv(np.linalg.cholesky(np.asarray(cov)[known]))
        except np.linalg.LinAlgError:
            raise ValueError(
                "cov has a matrix that is not positive definite; give the noise's covariance"
            ) from None
        solution = self._solver.solve(np.where(known[:, None], displacement, 0.0), whitening, self._support)
        self._support = None if solution is None else solution.support
        return (
            self._without(ContactReason.NOTHING_TOUCHED, 0.0) if solution is None else self._answer(solution)
        )

    def _without(self, reason: ContactReason, value: float) -> ContactForce:
        none = np.full((3, 3), np.nan)
        return ContactForce(
            reason, np.full(3, value), none, np.full(3, value), none, self.about_mm, (), self.gel.loads_mm,
            np.full((len(self.gel.loads_mm), 3), value), np.full((len(self.layout.xy_mm), 3), value), np.nan, np.nan,
        )  # fmt: skip

    def _answer(self, solution: Solution) -> ContactForce:
        support, gel = solution.support, self.gel
        force = self.young_mpa * solution.traction * gel.area_mm2[support, None]
        peak = self.young_mpa * solution.traction
        patches = find_patches(gel, self._smoothed(support, -peak[:, 2]), support, -force[:, 2])
        doubt = np.zeros(len(support))
        for patch in patches:
            mine = patch.members
            load = -force[mine, 2].sum() / (patch.area_mm2 * self.young_mpa)
            width = float(np.sqrt(patch.area_mm2 / np.pi)) / gel.thickness_mm
            # beyond the computed range, which the reason states, the factor does not grow
            factor = 1 + self.model.strain_factor * width * min(load, self.model.largest_load) ** 2
            narrow = gel.spacing_mm / (width * gel.thickness_mm)
            error = np.hypot(self.model.strain_sigma * width * load**2, self.model.narrow_error * narrow**2)
            doubt[mine] = error * force[mine, 2]
            force[mine, 2] *= factor
            peak[mine, 2] *= factor
        loads = _Loads(support, self._places(solution), force, doubt)
        scale = np.array([self.model.noise_sideways, self.model.noise_sideways, self.model.noise_upright])
        deviation = np.tile(scale * (self.young_mpa * solution.chi), len(support))
        noise = solution.inverse * np.outer(deviation, deviation)
        parts = [self._summed(patch.members, loads, noise) for patch in patches]
        whole = parts[0] if len(parts) == 1 else self._summed(np.arange(len(support)), loads, noise)
        regions = tuple(self._region(*each, loads, noise) for each in zip(patches, parts, strict=True))
        shear = float(np.hypot(*whole.force[:2]))
        return ContactForce(
            reason=self._reason(whole, patches, support),
            force_n=whole.force,
            force_cov_n2=whole.force_cov,
            torque_nmm=whole.torque,
            torque_cov_nmm2=whole.torque_cov,
            about_mm=self.about_mm,
            regions=tuple(sorted(regions, key=lambda region: float(region.force_n[2]))),
            loads_mm=gel.loads_mm,
            traction_mpa=_gaussians(gel.loads_mm, gel.loads_mm[support], gel.width_mm) @ peak,
            marker_traction_mpa=_gaussians(self.layout.xy_mm, gel.loads_mm[support], gel.width_mm) @ peak,
            utilisation=np.nan if self.friction is None else shear / (self.friction * -float(whole.force[2])),
            misfit=solution.chi,
        )

    def _smoothed(self, support: NDArray[np.intp], peak_mpa: Array) -> Array:
        """(K,) pressure at the loads. The tractions of neighbouring loads scatter, so it is smoothed."""
        width = SMOOTH_SPACINGS * self.gel.spacing_mm
        loads = self.gel.loads_mm
        return np.asarray(
            (self.gel.width_mm / width) ** 2 * times(_gaussians(loads, loads[support], width), peak_mpa)
        )

    def _places(self, solution: Solution) -> Array:
        """(S, 3) places of the loads after the displacement by themselves, at the depth of the markers."""
        loads, columns = self.gel.loads_mm[solution.support], solution.support[:, None] * 3 + np.arange(3)
        moved = times(self.gel.matrix[:, columns.ravel()], solution.traction.ravel()).reshape(-1, 3)
        weight = _gaussians(loads, self.layout.xy_mm, self.gel.spacing_mm)
        mean = weight @ moved / weight.sum(axis=1, keepdims=True)
        return np.asarray(np.pad(loads, [(0, 0), (0, 1)]) + mean)

    def _summed(self, members: NDArray[np.intp], loads: _Loads, noise: Array) -> _Sum:
        area = self.gel.area_mm2[loads.support[members]]
        arm, part = loads.place_mm[members] - self.about_mm, loads.force_n[members]
        turning = np.concatenate([np.broadcast_to(np.eye(3), (len(members), 3, 3)), _crossing(arm)], axis=1)
        total, torque = np.split(np.einsum("sij,sj->i", turning, part), 2)
        to_wrench = (turning * area[:, None, None]).transpose(1, 0, 2).reshape(6, -1)
        rows = (3 * members[:, None] + np.arange(3)).ravel()
        cov = to_wrench @ noise[np.ix_(rows, rows)] @ to_wrench.T
        model, share = self.model, np.abs(part[:, 2]) / max(float(np.abs(part[:, 2]).sum()), 1e-12)
        sideways = (model.shear_error * np.hypot(*total[:2])) ** 2 + (model.shear_by_press * total[2]) ** 2
        upright = (model.normal_error * total[2]) ** 2 + loads.doubt_n[members].sum() ** 2
        own = np.diag([sideways, sideways, upright]) + self.young_share**2 * np.outer(total, total)
        # an error of the forces turns by their arm; one of the arm, by the force
        centre = share @ arm
        by_force, by_place = _crossing(centre[None])[0], _crossing(total[None])[0]
        place = model.centre_error * self._radius(loads.place_mm[members, :2], share)
        about_centre = torque - by_force @ total
        own_torque = by_force @ own @ by_force.T + place**2 * by_place @ by_place.T
        own_torque += np.diag((model.torque_error * about_centre) ** 2)
        return _Sum(total, cov[:3, :3] + own, torque, cov[3:, 3:] + own_torque)

    def _radius(self, at_mm: Array, share: Array) -> float:
        """Of a contact, by the mean square distance from its centre; at least one spacing of loads."""
        spread = share @ ((at_mm - share @ at_mm) ** 2).sum(axis=1)
        return max(float(np.sqrt(HERTZ * spread)), self.gel.spacing_mm)

    def _region(self, patch: Patch, whole: _Sum, loads: _Loads, noise: Array) -> Region:
        at = self.gel.loads_mm[loads.support[patch.members]]
        press = -loads.force_n[patch.members, 2]
        centre = press @ at / press.sum()
        rows = 3 * patch.members + 2
        by_load = (at - centre) * (self.gel.area_mm2[loads.support[patch.members]] / press.sum())[:, None]
        slant = float(np.hypot(*whole.force[:2]) / press.sum())
        place = np.hypot(self.model.centre_error, self.model.centre_by_shear * slant)
        place *= self._radius(at, press / press.sum())
        cov = by_load.T @ noise[np.ix_(rows, rows)] @ by_load + place**2 * np.eye(2)
        return Region(
            patch.area_mm2, AREA_ERROR * patch.area_mm2, patch.outline_mm, centre, cov,
            whole.force, whole.force_cov, whole.torque, whole.torque_cov,
        )  # fmt: skip

    def _reason(self, whole: _Sum, patches: list[Patch], support: NDArray[np.intp]) -> ContactReason:
        area = sum(patch.area_mm2 for patch in patches)
        if -whole.force[2] / (area * self.young_mpa) > self.model.largest_load:
            return ContactReason.BEYOND_STRAIN
        if -whole.force[2] < MIN_SIGMAS * np.sqrt(whole.force_cov[2, 2]):
            return ContactReason.TOO_LITTLE_FORCE
        if (self._rim_mm[support] < self.model.rim_spacings * self.gel.spacing_mm).any():
            return ContactReason.AT_RIM
        return ContactReason.NONE


@dataclass(frozen=True, eq=False)
class _Loads:
    """The loads that press: (S,) ids, (S, 3) places and forces, and (S,) deviations of z by the strain factor."""

    support: NDArray[np.intp]
    place_mm: Array
    force_n: Array
    doubt_n: Array


@dataclass(frozen=True, eq=False)
class _Sum:
    """Force and torque of some loads, with covariances."""

    force: Array
    force_cov: Array
    torque: Array
    torque_cov: Array


def _gaussians(points_mm: Array, centres_mm: Array, width_mm: float) -> Array:
    """(N, S) values at points of Gaussians of peak 1 around centres."""
    x, y = (np.subtract.outer(points_mm[:, k], centres_mm[:, k]) for k in (0, 1))
    return np.asarray(np.exp((x * x + y * y) / (-2 * width_mm**2)))


def _crossing(arms: Array) -> Array:
    """(N, 3, 3) matrices that turn forces into torques at arms (N, 3)."""
    matrix = np.zeros((len(arms), 3, 3))
    matrix[:, [1, 2, 0], [2, 0, 1]] = -arms
    matrix[:, [2, 0, 1], [1, 2, 0]] = arms
    return matrix


def _distance_inside(outline_mm: Array, points_mm: Array) -> Array:
    """(N,) distance of points to the nearest side of an outline."""
    start, end = outline_mm, np.roll(outline_mm, -1, axis=0)
    side = end - start
    along = np.einsum("nkd,kd->nk", points_mm[:, None] - start, side) / (side**2).sum(axis=1)
    foot = start + np.clip(along, 0, 1)[..., None] * side
    return np.asarray(np.linalg.norm(points_mm[:, None] - foot, axis=2).min(axis=1))
