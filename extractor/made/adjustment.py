"""The adjustment of rest pictures: one homography per picture and one place per marker, by maximum likelihood.

A reading x of marker m in picture v, with the stated covariance C, is H_v(p_m) plus an error of covariance C. Maximum
likelihood over all H_v and p_m is a bundle adjustment (Triggs et al., *Bundle adjustment: a modern synthesis*, 2000):
Gauss-Newton, with the places eliminated from the normal equations by Schur's complement.

The readings fix the places up to one homography common to all places, eight numbers: position, turn, two scales,
shear and perspective of the whole pad. This homography is chosen so that the places lie nearest to the nominal places,
by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.homographies import (
    PARAMETERS,
    Array,
    derivatives,
    fitted_homography,
    mapped,
    moved,
    normalised,
    scaling,
)

STEPS = 20
CONVERGED_DEVIATIONS = 1e-4  # largest step of a place, in standard deviations; chosen


class Readings(NamedTuple):
    """M markers read in V pictures.

    Attributes:
        xy_px: (V, M, 2) float64, NaN where a marker is not measured.
        cov_px2: (V, M, 2, 2) float64, the stated covariances.
    """

    xy_px: Array
    cov_px2: Array


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The most likely places.

    Attributes:
        xy_mm: (M, 2) float64, NaN where no picture shows the marker.
        cov_mm2: (M, 2, 2) float64, of the places as far as they are determined; the common homography is not determined
            and is not included. By the stated covariances, times ``z`` squared.
        z: root of chi squared over its degrees of freedom: residuals over stated deviations.
        picture_z: (V,) the same of each picture.
        picture_rms_px: (V,) root mean square of the residuals per axis, corrected for the degrees of freedom.
    """

    xy_mm: Array
    cov_mm2: Array
    z: float
    picture_z: Array
    picture_rms_px: Array


class _Linear(NamedTuple):
    """The normal equations, linearised; the places' blocks are 0 where a marker is not read.

    Attributes:
        by_entries: (8 V, 8 V) of the homographies.
        cross: (M, 2, 8 V) between places and homographies.
        inverse: (M, 2, 2) inverse blocks of the places.
        right_entries, right_places: (8 V,) and (M, 2), the gradient.
    """

    by_entries: Array
    cross: Array
    inverse: Array
    right_entries: Array
    right_places: Array


def adjust_places(readings: Readings, nominal_mm: Array) -> Adjustment:
    """The most likely places of markers that pictures of one flat, rigid pad show.

    Args:
        readings: each picture with four markers at least, not all but one of them on a line.
        nominal_mm: (M, 2) the layout's places.

    Raises:
        numpy.linalg.LinAlgError: the markers of a picture determine no homography.
    """
    read: NDArray[np.bool_] = np.asarray(np.isfinite(readings.xy_px).all(axis=2))
    seen: NDArray[np.bool_] = np.asarray(read.any(axis=0))
    to_unit, px_to_unit = scaling(nominal_mm[seen]), scaling(readings.xy_px.reshape(-1, 2))
    nominal = mapped(to_unit, nominal_mm)
    observed = np.where(read[..., None], mapped(px_to_unit, readings.xy_px), 0.0)
    weight = np.zeros_like(readings.cov_px2)
    weight[read] = np.linalg.inv(readings.cov_px2[read] * px_to_unit[0, 0] ** 2)
    homographies = np.stack(
        [fitted_homography(nominal[own], xy[own]) for own, xy in zip(read, observed, strict=True)]
    )
    places = nominal.copy()
    for _ in range(STEPS):
        linear = _linearised(homographies, places, observed, weight)
        step, at_places = _solved(linear)
        homographies, places = moved(homographies, step), places + at_places
        information = np.linalg.pinv(linear.inverse[seen], hermitian=True)
        squares = np.einsum("mi,mij,mj->m", at_places[seen], information, at_places[seen])
        if squares.max() < CONVERGED_DEVIATIONS**2:
            break
    homographies, places = _nearest_to(nominal, seen, homographies, places)
    linear = _linearised(homographies, places, observed, weight)
    residual = np.where(read[..., None], observed - mapped(homographies, places), 0.0)
    squares = np.einsum("vmi,vmij,vmj->v", residual, weight, residual)
    axes = 2.0 * read.sum(axis=1)
    # Without redundancy, as with one picture, the residuals have no information.
    redundancy = axes.sum() - 2.0 * seen.sum() - PARAMETERS * (len(read) - 1)
    share = redundancy / axes.sum() if redundancy > 0 else np.nan
    z2 = float(squares.sum() / redundancy) if redundancy > 0 else np.nan
    covariance = _covariances(linear, nominal, seen) * (z2 / to_unit[0, 0] ** 2)
    rms = np.sqrt((residual**2).sum(axis=(1, 2)) / (axes * share)) / px_to_unit[0, 0]
    xy_mm = mapped(np.asarray(np.linalg.inv(to_unit), np.float64), places)
    return Adjustment(
        xy_mm=np.where(seen[:, None], xy_mm, np.nan),
        cov_mm2=np.where(seen[:, None, None], covariance, np.nan),
        z=float(np.sqrt(z2)),
        picture_z=np.sqrt(squares / (axes * share)),
        picture_rms_px=rms,
    )


def _linearised(homographies: Array, places: Array, observed: Array, weight: Array) -> _Linear:
    """The normal equations at (V, 3, 3) homographies and (M, 2) places; weights (V, M, 2, 2) are 0 where unread."""
    views, markers = weight.shape[:2]
    by_entries, by_point = derivatives(homographies, places)
    residual = observed - mapped(homographies, places)
    weighted = np.swapaxes(by_entries, 2, 3) @ weight  # (V, M, 8, 2)
    own = np.einsum("vmai,vmib->vab", weighted, by_entries)
    square = np.zeros((views, PARAMETERS, views, PARAMETERS))
    square[np.arange(views), :, np.arange(views), :] = own
    at_point = np.swapaxes(by_point, 2, 3) @ weight  # (V, M, 2, 2)
    blocks = (at_point @ by_point).sum(axis=0)
    cross = np.ascontiguousarray(np.moveaxis(at_point @ by_entries, 0, 2))  # (M, 2, V, 8)
    return _Linear(
        by_entries=square.reshape(views * PARAMETERS, -1),
        cross=cross.reshape(markers, 2, views * PARAMETERS),
        inverse=np.linalg.pinv(blocks, hermitian=True),
        right_entries=np.einsum("vmai,vmi->va", weighted, residual).ravel(),
        right_places=np.einsum("vmai,vmi->ma", at_point, residual),
    )


def _solved(linear: _Linear) -> tuple[Array, Array]:
    """The steps (V, 8) of the homographies and (M, 2) of the places, the shortest along undetermined directions."""
    gain = linear.inverse @ linear.cross
    right = linear.right_entries - np.einsum("mia,mi->a", gain, linear.right_places)
    step = _undetermined_inverse(linear, gain) @ right
    at_places = np.einsum("mij,mj->mi", linear.inverse, linear.right_places) - gain @ step
    return step.reshape(-1, PARAMETERS), at_places


def _undetermined_inverse(linear: _Linear, gain: Array) -> Array:
    """(8 V, 8 V) the inverse of Schur's complement of the homographies, without the eight undetermined directions."""
    count = len(linear.by_entries)
    complement = linear.by_entries - linear.cross.reshape(-1, count).T @ gain.reshape(-1, count)
    scale = 1.0 / np.sqrt(linear.by_entries.diagonal())
    values, vectors = np.linalg.eigh(complement * scale[:, None] * scale)
    kept = scale[:, None] * vectors[:, PARAMETERS:]
    return np.asarray((kept / values[PARAMETERS:]) @ kept.T)


def _nearest_to(
    nominal: Array, seen: NDArray[np.bool_], homographies: Array, places: Array
) -> tuple[Array, Array]:
    """The same pictures with places that lie nearest to the nominal places."""
    common = fitted_homography(places[seen], nominal[seen])
    return normalised(homographies @ np.linalg.inv(common)), mapped(common, places)


def _covariances(linear: _Linear, nominal: Array, seen: NDArray[np.bool_]) -> Array:
    """(M, 2, 2) of the places with the common homography fixed by the nominal places; 0 where not seen.

    Of the places' full covariance D + G S G', D of blocks, the part that a common homography B of all markers makes is
    projected out: (1 - P) (D + G S G') (1 - P)' with P = B (B' B)^-1 B'.
    """
    gain = linear.inverse @ linear.cross
    common = np.where(seen[:, None, None], derivatives(np.eye(3), nominal)[0], 0.0)  # (M, 2, 8)
    rows = common.reshape(-1, PARAMETERS)
    inverse = np.linalg.inv(rows.T @ rows)
    outer = common @ inverse @ np.swapaxes(common, 1, 2) @ linear.inverse  # the blocks of P D
    spread = inverse @ np.einsum("mia,mij,mjb->ab", common, linear.inverse, common) @ inverse
    blocks = linear.inverse - outer - np.swapaxes(outer, 1, 2)
    blocks += common @ spread @ np.swapaxes(common, 1, 2)
    along = inverse @ np.einsum("mia,mib->ab", common, gain)
    free = gain - common @ along
    return np.asarray(blocks + free @ _undetermined_inverse(linear, gain) @ np.swapaxes(free, 1, 2))
