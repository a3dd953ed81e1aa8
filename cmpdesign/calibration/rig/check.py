"""Whether a sensor still is as its file says, by the markers of new pictures at rest.

With the file's views, the residuals at rest must be those of the calibration. If they are larger, every cause that is
known is a model with further parameters: a pad that lies otherwise, moved cameras or mirrors, another focus, another
gel, a pattern of another size. The likely cause has the smallest final prediction error (Akaike 1969),
chi^2 / (N - K) (1 + K / N) with N numbers and K parameters; causes with nearly the same error are not told apart by
the pictures, and all are named but those of which another is a part. What no cause explains is local: a touch, dirt.
Points beyond ``HUBER`` deviations weigh less (Huber 1964).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.rig.adjustment import RigStep
from cmpdesign.calibration.rig.calibration import as_step, mean_of, misread_displacements, press_of
from cmpdesign.calibration.rig.causes import LOCAL, PARTS, STEPS, Column, columns_by_cause
from cmpdesign.calibration.rig.unknowns import Unknowns, see
from cmpdesign.documents.calibration import CalibrateCheckDocument, CausePart
from extractor import Markers, Reference, Rig, RigError, View
from extractor.space.camera import is_covariance, is_finite

Array = NDArray[np.float64]

MAX_MISFIT = (
    3.0  # residuals over those of the calibration, from which it does not hold; as of a rest frame. Chosen
)
EXPLAINED = 0.25  # share of the residuals that a cause may leave to count as the likely one; chosen
ALIKE = 16.0  # squares beyond those of the best cause, in its mean squares, up to which a cause is named, too; chosen
HUBER = 4.0  # deviations
ROUNDS = 20  # of Levenberg-Marquardt
INITIAL_DAMPING, RIDGE = 1e-6, 1e-12  # of columns of length 1
CONVERGED = 1e-3  # of the squares in a step
UNSEEN = 1e3  # deviations of a marker that the views cannot show


class _Fit(NamedTuple):
    """The views and points of a cause, their residuals (V, M, 2) px, Huber's cost, and the K coefficients."""

    views: tuple[View, ...]
    residual_px: Array
    chi2: float
    values: Array


def check_markers(
    layout: Reference,
    rig: Rig,
    rest: Mapping[str, Sequence[Markers]],
    *,
    stated_px: Mapping[str, float],
    scale: float = 1.0,
    limit_px: float | None = None,
    **state: Any,
) -> CalibrateCheckDocument:
    """Compare pictures of the pad at rest with a calibrated rig.

    Args:
        layout: the pad's.
        rig: calibrated, with poses.
        rest: name of a picture -> its markers, view by view; one or more.
        stated_px: view -> RMS residual at the calibration; empty where the file does not tell.
        scale: residuals at the calibration over the stated deviations of the markers.
        limit_px: largest RMS residual; None: by the deviations.
        state: the fields of the document that do not follow from residuals; see ``state.py``.

    Returns:
        The document; ``found`` is the tuple of the causes that explain the residuals and that the pictures do not tell
        apart, empty where the calibration holds. ``depth_error`` is above 0 where depths are read too deep.
    """
    pictures = {name: as_step(one, 0.0) for name, one in rest.items()}
    today = _Today(layout, rig.views, mean_of(list(pictures.values())), max(scale, 1.0))
    unchanged, causes = today.fitted([]), columns_by_cause(today.unknowns)
    alone = {name: _Today(layout, rig.views, one, today.scale).fitted([]) for name, one in pictures.items()}
    found = {cause: today.fitted(columns) for cause, columns in causes.items()}
    errors = {cause: today.error(found[cause]) for cause in causes}
    order, misfit = sorted(errors, key=lambda cause: errors[cause]), today.error(unchanged)
    rms_px = np.sqrt(np.nanmean(unchanged.residual_px**2, axis=(1, 2)))
    holds = misfit <= MAX_MISFIT if limit_px is None else rms_px.max() <= limit_px
    likely = () if holds else _likely(errors, misfit, today.numbers)
    parts = []
    for cause in order:
        names = [column.name for column in causes[cause]]
        changes = dict(zip(names, found[cause].values.tolist(), strict=True))
        parts.append(CausePart(cause=cause, left=errors[cause], changes=changes, likely=cause in likely))
    depth_error = today.depth_error(found[likely[0]].views) if set(likely) & set(found) else float("nan")
    return CalibrateCheckDocument.of(
        likely,
        holds=not likely,
        rms_px=dict(zip(rig.names, rms_px.tolist(), strict=True)),
        stated_px=stated_px,
        misfit=misfit,
        limit_px=limit_px,
        picture_misfits={name: today.error(one) for name, one in alone.items()},
        causes=parts,
        steps=tuple(STEPS[cause] for cause in likely),
        depth_error=depth_error if np.isfinite(depth_error) else None,
        **state,
    )


def _likely(errors: Mapping[str, float], misfit: float, numbers: int) -> tuple[str, ...]:
    """The causes that explain the residuals nearly as well as the best one, without those that hold another."""
    best = min(errors.values())
    if best > EXPLAINED * misfit:
        return (LOCAL,)
    most = best * (1 + ALIKE / numbers) ** 0.5
    alike = [cause for cause in sorted(errors, key=lambda one: errors[one]) if errors[cause] <= most]
    return tuple(one for one in alike if not any(part in alike for part in PARTS.get(one, ())))


@dataclass(frozen=True, eq=False)
class _Today:
    """The markers at rest, and the sensor of the file."""

    layout: Reference
    views: tuple[View, ...]
    rest: RigStep
    scale: float

    @property
    def flat_mm(self) -> Array:
        return np.column_stack([self.layout.xy_mm, np.zeros(len(self.layout.xy_mm))])

    @cached_property
    def unknowns(self) -> Unknowns:
        medium = self.views[0].medium
        return Unknowns(self.views, ("gel_mm", "gel_index") if medium is not None and medium.gel_mm else ())

    @cached_property
    def root(self) -> Array:
        """(V, M, 2, 2) whitening matrices; 0 where not seen."""
        seen = is_finite(self.rest.xy_px) & is_covariance(self.rest.cov_px2)
        cov = np.where(seen[..., None, None], self.rest.cov_px2, np.eye(2))
        return np.where(seen[..., None, None], np.linalg.inv(np.linalg.cholesky(cov)) / self.scale, 0.0)

    @property
    def numbers(self) -> int:
        """Two for each marker in each view."""
        return 2 * int((self.root[..., 0, 0] > 0).sum())

    def fitted(self, columns: Sequence[Column]) -> _Fit:
        """Levenberg-Marquardt in the parameters of one cause."""
        basis = np.zeros((self.unknowns.count + 1, len(columns)))
        for k, column in enumerate(columns):
            basis[:, k] = column.effect
        best, damping = self._at(basis, np.zeros(len(columns))), INITIAL_DAMPING
        for _ in range(ROUNDS if len(columns) else 0):
            design, residual = self._equations(basis, best)
            size = np.linalg.norm(design, axis=0) + RIDGE
            damped = np.vstack([design / size, np.sqrt(damping) * np.eye(len(size))])
            step = np.linalg.lstsq(damped, np.append(residual, 0 * size), rcond=None)[0] / size
            tried = self._tried(basis, best.values + step)
            if tried is None or tried.chi2 > best.chi2:
                damping = 10 * damping
                continue
            gain, best, damping = best.chi2 - tried.chi2, tried, damping / 100
            if gain < CONVERGED:
                break
        return best

    def _tried(self, basis: Array, values: Array) -> _Fit | None:
        """The fit with these coefficients; None where no sensor has them."""
        try:
            return self._at(basis, values)
        except RigError:
            return None

    def _at(self, basis: Array, values: Array) -> _Fit:
        whole, count = basis @ values, self.unknowns.count
        views = (
            self.unknowns.deviation(whole[:count]).applied(self.views) if whole[:count].any() else self.views
        )
        xyz_mm = self.flat_mm * (1 + whole[count])
        residual_px = self.rest.xy_px - np.stack([view.project(xyz_mm) for view in views])
        distance = np.linalg.norm(self._whitened(residual_px), axis=-1)
        far = 2 * HUBER * distance - HUBER**2
        return _Fit(views, residual_px, float(np.where(distance <= HUBER, distance**2, far).sum()), values)

    def _whitened(self, residual_px: Array) -> Array:
        """(V, M, 2) in deviations; 0 where not seen."""
        seen = self.root[..., 0, 0] > 0
        whitened = (self.root @ np.where(seen[..., None], residual_px, 0.0)[..., None])[..., 0]
        return np.where(np.isfinite(whitened), whitened, UNSEEN)

    def _equations(self, basis: Array, at: _Fit) -> tuple[Array, Array]:
        """The design (2 V M, K) and the residuals (2 V M,) at a fit, weighted."""
        size = float(basis[-1] @ at.values)
        seen = see(self.unknowns, at.views, self.flat_mm * (1 + size))
        by_size = seen.by_point @ self.flat_mm[:, :, None]
        columns = np.concatenate([seen.by_unknowns, by_size], axis=3) @ basis
        residual = self._whitened(at.residual_px)
        distance = np.linalg.norm(residual, axis=-1)
        weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(distance, 1e-12)))
        weight[distance >= UNSEEN] = 0.0
        design = self.root @ np.nan_to_num(columns) * weight[..., None, None]
        return design.reshape(-1, basis.shape[1]), (residual * weight[..., None]).ravel()

    def error(self, fit: _Fit) -> float:
        """The root of the final prediction error, in residuals of the calibration."""
        numbers, parameters = self.numbers, len(fit.values)
        if numbers <= parameters:
            return float("inf")
        return float(np.sqrt(fit.chi2 / (numbers - parameters) * (1 + parameters / numbers)))

    def depth_error(self, views: tuple[View, ...]) -> float:
        """By how much of itself the depth of a press is read wrong by the file's views, where others are true."""
        if len(self.views) < 2:
            return float("nan")
        read = misread_displacements(self.flat_mm, self.rest.cov_px2, self.views, [views])
        return float(np.nanmean(read[0, 0, :, 2]) / press_of(self.views))
