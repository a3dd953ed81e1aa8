"""Cameras from points: against truth, against OpenCV, on real corners; pictures that contradict, and refusals."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cmpdesign.calibration.camera import calibrate_points
from cmpdesign.calibration.models import MODELS
from cmpdesign.calibration.rays import pixel_grid, ray_covariances, ray_differences
from cmpdesign.calibration.sightings import Sheet, Sighting
from cmpdesign.errors import CmpDesignError
from extractor import View
from tests.support.calibration.sheets import (
    SIZE_PX,
    camera,
    chessboards,
    fisheye,
    lattice,
    see,
    without_deviations,
    zoomed,
)

FEW = MODELS[:2]
# The part of the image where points lie.
MIDDLE = np.array(SIZE_PX) / 2 + 0.65 * (pixel_grid(SIZE_PX, 8, 6) - np.array(SIZE_PX) / 2)


def opencv_calibration(sheet: Sheet, sightings: list[Sighting], flags: int) -> tuple[float, View]:
    places = [sheet.flat_mm[one.ids].astype(np.float32) for one in sightings]
    pixels = [one.xy_px.astype(np.float32)[:, None] for one in sightings]
    rms, matrix, lens, _, _ = cv2.calibrateCamera(places, pixels, SIZE_PX, None, None, flags=flags)  # type: ignore[call-overload]
    count = 8 if flags else 5
    focal, centre = (matrix[0, 0], matrix[1, 1]), (matrix[0, 2], matrix[1, 2])
    return rms, View("opencv", focal, centre, tuple(lens.ravel()[:count]))


@pytest.mark.parametrize(("view", "model"), [(camera(), "5 coefficients"), (fisheye(), "fisheye")])
def test_parameters_and_rays_are_as_exact_as_stated(view: View, model: str) -> None:
    sheet, parameters, rays = lattice(), [], []
    for seed in range(3):
        rng = np.random.default_rng([seed, 46])
        found = calibrate_points(sheet, see(view, sheet, 9, rng), SIZE_PX, FEW)
        assert found.model.name == model and not found.held and not found.bend_mm
        assert found.adjusted.base == pytest.approx(1, abs=0.1)
        true = np.array([*view.focal_px, *view.centre_px, *view.distortion])
        values = np.array([*found.camera.focal_px, *found.camera.centre_px, *found.camera.distortion])
        parameters.append((values - true) @ np.linalg.solve(found.cov, values - true) / len(true))
        error = ray_differences(found.camera, view, MIDDLE)
        cov = ray_covariances(found.camera, found.cov, MIDDLE)
        rays.append(np.mean(np.einsum("ni,nij,nj->n", error, np.linalg.pinv(cov, hermitian=True), error)) / 2)
        assert np.sqrt(np.mean(error**2)) < 0.05
    assert 0.5 < np.sqrt(np.mean(parameters)) < 1.6
    assert 0.4 < np.sqrt(np.mean(rays)) < 1.7


def test_the_fit_is_opencvs_where_all_points_weigh_the_same() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(3)
    sightings = without_deviations(see(view, sheet, 10, rng, sigma_px=0.05))
    rms, theirs = opencv_calibration(sheet, sightings, 0)
    ours = calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2])
    assert ours.rms_px * np.sqrt(2) == pytest.approx(rms, rel=1e-3)
    assert ours.adjusted.base == pytest.approx(0.0547, rel=0.1)  # px, RMS of the deviations that were drawn
    np.testing.assert_allclose(ray_differences(ours.camera, theirs, MIDDLE), 0, atol=0.01)


def test_a_bent_sheet_is_said_to_be_bent() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(4)
    sightings = see(view, sheet, 12, rng, height_mm=0.4)
    found = calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2])
    assert found.bend_mm == pytest.approx(0.4, rel=0.1)
    assert found.camera.focal_px[0] == pytest.approx(view.focal_px[0], abs=0.1)
    assert found.adjusted.base == pytest.approx(1, abs=0.1)


def test_pictures_that_contradict_are_named_with_their_cause() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(5)
    sightings = see(view, sheet, 10, rng)
    sightings[2] = zoomed(sightings[2], 0.02)
    (bent,) = see(view, sheet, 1, rng, height_mm=0.8)
    sightings[7] = bent._replace(name="p7.png")
    found = calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2])
    causes = {one.picture: one.cause for one in found.pictures if one.cause}
    assert set(causes) == {"p2.png", "p7.png"}
    assert "focal length" in causes["p2.png"] and "bent" in causes["p7.png"]
    assert found.camera.focal_px[0] == pytest.approx(view.focal_px[0], abs=0.2)


def test_deviations_follow_from_how_pictures_agree() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(9)
    exact, sigma_px, share = see(view, sheet, 10, rng, sigma_px=1e-6), 0.02, 0.7
    apart = np.linalg.norm(sheet.xy_mm[:, None] - sheet.xy_mm, axis=2)
    neighbours = (apart > 0) & (apart < 2.1)
    mixed = np.eye(len(apart)) - share * neighbours / neighbours.sum(axis=1)[:, None]
    mixed /= np.linalg.norm(mixed, axis=1)[:, None]
    found = []
    for mixing in (np.eye(len(mixed)), mixed):
        sightings = [
            one._replace(
                xy_px=one.xy_px + sigma_px * mixing @ rng.normal(size=one.xy_px.shape),
                cov_px2=np.tile(sigma_px**2 * np.eye(2), (len(mixed), 1, 1)),
            )
            for one in exact
        ]
        found.append(calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2]))
    independent, cancelling = found
    assert independent.adjusted.base == pytest.approx(cancelling.adjusted.base, rel=0.1)
    # errors that neighbours share cancel to 1 - share, shorter ones less
    assert (1 - share) / 1.04 < cancelling.ray_px / independent.ray_px < 0.55
    true = np.array([*view.focal_px, *view.centre_px, *view.distortion])
    error = (
        np.array([*cancelling.camera.focal_px, *cancelling.camera.centre_px, *cancelling.camera.distortion])
        - true
    )
    assert 0.5 < np.sqrt(error @ np.linalg.solve(cancelling.cov, error) / len(error)) < 1.6
    # a contradiction that is hidden in the scatter of the points, but not in the answer about the lens
    sightings[4] = zoomed(sightings[4], 0.002)
    doubtful = calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2])
    assert [one.picture for one in doubtful.pictures if not one.used] == ["p4.png"]
    assert max(one.scale for one in doubtful.pictures) < 2


def test_real_corners_are_explained_better_than_by_opencv() -> None:
    sheet, sightings = chessboards()
    found = calibrate_points(sheet, sightings, SIZE_PX)
    rms, theirs = opencv_calibration(sheet, sightings, cv2.CALIB_RATIONAL_MODEL)
    assert rms == pytest.approx(0.419, abs=0.002)
    assert found.rms_px * np.sqrt(2) < 0.75 * rms
    assert found.camera.focal_px[0] == pytest.approx(theirs.focal_px[0], rel=0.01)
    assert found.bend_mm > 0.02  # squares: the printed board is not flat


def test_pictures_of_one_tilt_are_refused_with_the_view_to_add() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(6)
    sightings = see(view, sheet, 6, rng, tilt_deg=(0, 0.2), sigma_px=0.05)
    with pytest.raises(
        CmpDesignError, match=r"focal length to .* limit 1%.*add a view: tilt the sheet by -?30 deg"
    ):
        calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2])


def test_too_little_is_refused() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(7)
    sightings = see(view, sheet, 3, rng)
    with pytest.raises(CmpDesignError, match="2 pictures show the sheet; a calibration needs 3"):
        calibrate_points(sheet, sightings[:2], SIZE_PX)
    few = sightings[0]
    few = Sighting("few.png", few.ids[:5], few.xy_px[:5], None)
    with pytest.raises(CmpDesignError, match=r"few\.png: 5 points; a calibration needs 12"):
        calibrate_points(sheet, [*sightings[1:], few], SIZE_PX)


def test_the_view_that_is_advised_helps_as_said() -> None:
    view, sheet, rng = camera(), lattice(), np.random.default_rng(8)
    sightings = see(view, sheet, 5, rng, tilt_deg=(8, 15))
    found = calibrate_points(sheet, sightings, SIZE_PX, MODELS[1:2])
    assert found.advice.ray_px < found.ray_px
    more = calibrate_points(
        sheet, [*sightings, *see(view, sheet, 5, rng, tilt_deg=(28, 32))], SIZE_PX, MODELS[1:2]
    )
    assert more.ray_px < found.ray_px
