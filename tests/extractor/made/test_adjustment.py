"""The places that many pictures imply: right with the stated covariances, whatever homographies the pictures have.

Inside: pictures have no errors of known covariance, and none is right in all but one marker.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from extractor.made.adjustment import Adjustment, Readings, adjust_places
from tests.support.layouts import small_layout

Array = NDArray[np.float64]
PICTURES = 10
SCATTER_MM = 0.02
NOMINAL_MM = small_layout("honeycomb", 5).marker_xy_mm
MARKERS = len(NOMINAL_MM)
NEVER_SEEN, SEEN_ONCE = 7, 12


def sample_homography(rng: np.random.Generator) -> Array:
    """About 20 px for a mm, turned, sheared and with strong perspective."""
    turn = rng.uniform(0, 2 * np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    h = np.eye(3)
    h[:2, :2] = rng.uniform(15, 25) * rotation @ (np.eye(2) + rng.normal(0, 0.1, (2, 2)))
    h[:2, 2], h[2, :2] = rng.uniform(200, 300, 2), rng.normal(0, 0.01, 2)
    return h


def nearest_to_nominal(xy_mm: Array, chosen: NDArray[np.bool_]) -> Array:
    """The places moved by the homography that brings the chosen ones nearest to the nominal ones."""
    common, _ = cv2.findHomography(xy_mm[chosen], NOMINAL_MM[chosen])
    return np.asarray(cv2.perspectiveTransform(xy_mm[None], common)[0])


def sample(seed: int, noise: float = 1.0) -> tuple[Readings, Array]:
    """Readings with errors of their covariances, times ``noise``, and the true places."""
    rng = np.random.default_rng(seed)
    made_mm = NOMINAL_MM + rng.normal(0, SCATTER_MM, NOMINAL_MM.shape)
    true_px = np.stack(
        [cv2.perspectiveTransform(made_mm[None], sample_homography(rng))[0] for _ in range(PICTURES)]
    )
    factor = rng.normal(0, 0.01, (PICTURES, MARKERS, 2, 2))
    cov_px2 = factor @ np.swapaxes(factor, 2, 3) + 5e-5 * np.eye(2)
    error = np.linalg.cholesky(cov_px2) @ rng.normal(size=(PICTURES, MARKERS, 2, 1))
    xy_px = true_px + noise * error[..., 0]
    xy_px[rng.uniform(size=(PICTURES, MARKERS)) < 0.1] = np.nan
    xy_px[:, NEVER_SEEN], xy_px[1:, SEEN_ONCE], xy_px[0, SEEN_ONCE] = np.nan, np.nan, true_px[0, SEEN_ONCE]
    return Readings(xy_px, cov_px2), nearest_to_nominal(made_mm, np.arange(MARKERS) != NEVER_SEEN)


def adjusted(seed: int, noise: float = 1.0) -> tuple[Adjustment, Array]:
    readings, true_mm = sample(seed, noise)
    found = adjust_places(readings, NOMINAL_MM)
    return found, found.xy_mm - true_mm


def test_errors_have_the_stated_covariances() -> None:
    squares = []
    for seed in range(20):
        found, error = adjusted(seed)
        known = np.isfinite(error[:, 0])
        assert np.flatnonzero(~known).tolist() == [NEVER_SEEN]
        assert np.isnan(found.cov_mm2[NEVER_SEEN]).all()
        known[SEEN_ONCE] = False  # its one reading has no error
        inverse = np.linalg.inv(found.cov_mm2[known])
        squares.append(np.einsum("mi,mij,mj->m", error[known], inverse, error[known]))
    assert np.sqrt(np.mean(squares) / 2) == pytest.approx(1, abs=0.04)


def test_errors_are_far_smaller_than_scatter_and_than_one_reading() -> None:
    found, error = adjusted(1)
    one_reading_mm = 0.01 / 20
    assert np.nanmax(np.abs(error)) < SCATTER_MM / 10
    assert np.sqrt(np.nanmean(error**2)) < one_reading_mm / 2
    seen_once = np.sqrt(found.cov_mm2[SEEN_ONCE].trace() / 2)
    assert seen_once > 2 * np.sqrt(np.nanmedian(found.cov_mm2.trace(axis1=1, axis2=2)) / 2)


def test_exact_readings_give_exact_places() -> None:
    found, error = adjusted(2, noise=0.0)
    assert np.nanmax(np.abs(error)) < 1e-6
    assert found.z < 1e-6


def test_residuals_say_how_wrong_the_stated_covariances_are() -> None:
    """The covariances of the places grow as the residuals do."""
    right, wrong = adjusted(3)[0], adjusted(3, noise=3.0)[0]
    assert right.z == pytest.approx(1, abs=0.08)
    assert wrong.z == pytest.approx(3 * right.z, rel=0.01)
    np.testing.assert_allclose(right.picture_z, 1, atol=0.3)
    ratio = wrong.cov_mm2.trace(axis1=1, axis2=2) / right.cov_mm2.trace(axis1=1, axis2=2)
    assert np.nanmedian(ratio) == pytest.approx(9, rel=0.05)


def test_the_homographies_of_the_pictures_do_not_matter() -> None:
    """Readings of another view of the pad give the same positions, if the covariances are of this view."""
    readings, _ = sample(4)
    h = np.array([[0.8, 0.3, 5.0], [-0.4, 1.1, 9.0], [1e-4, -2e-4, 1.0]])
    px = np.nan_to_num(readings.xy_px)
    other = cv2.perspectiveTransform(px, h)
    weight = px @ h[2, :2] + 1
    slope = (h[:2, :2] - other[..., None] * h[2, :2]) / weight[..., None, None]
    cov = slope @ readings.cov_px2 @ np.swapaxes(slope, 2, 3)
    moved = Readings(np.where(np.isfinite(readings.xy_px), other, np.nan), cov)
    first, second = adjust_places(readings, NOMINAL_MM), adjust_places(moved, NOMINAL_MM)
    # To the first order of the residuals, as the errors are normal in one view only.
    np.testing.assert_allclose(second.xy_mm, first.xy_mm, atol=1e-6)
    np.testing.assert_allclose(second.cov_mm2, first.cov_mm2, rtol=0.01, atol=1e-10)


def test_a_picture_that_is_no_homography_of_the_others_is_told() -> None:
    readings, _ = sample(5)
    bulge = 0.3 * np.exp(-((NOMINAL_MM / 3) ** 2).sum(axis=1))
    readings.xy_px[6, :, 0] += bulge
    found = adjust_places(readings, NOMINAL_MM)
    assert found.picture_z.argmax() == 6 and found.picture_z[6] > 3 * np.median(found.picture_z)
    assert found.picture_rms_px[6] > 2 * np.median(found.picture_rms_px)
