"""Inside: lenses against OpenCV's, their derivatives, and their exact inverse."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from extractor.space.lens import COUNTS, Lens

LENSES = (
    Lens("perspective", (-0.2, 0.05, 0.001, -0.002, 0.01)),
    Lens("perspective", (0.4, 0.1, 0.001, -0.002, 0.01, 0.9, 0.3, 0.02)),
    Lens("perspective", (0.4, 0.1, 0.001, -0.002, 0.01, 0.9, 0.3, 0.02, 0.002, -0.001, 0.003, 0.001)),
    Lens("fisheye", (0.02, -0.01, 0.003, -0.001)),
)


def directions(most: float, count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(3)
    radius, angle = most * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def opencv_places(lens: Lens, direction: np.ndarray) -> np.ndarray:
    points = np.column_stack([direction, np.ones(len(direction))])[:, None]
    project = cv2.fisheye.projectPoints if lens.kind == "fisheye" else cv2.projectPoints
    still = np.zeros((3, 1))
    return project(points, still, still, np.eye(3), np.array(lens.coefficients))[0][:, 0]


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: f"{lens.kind}{len(lens.coefficients)}")
def test_places_are_opencvs_and_come_back(lens: Lens) -> None:
    assert len(lens.coefficients) in COUNTS[lens.kind]
    direction = directions(min(0.95 * lens.fold_radius, 3.0))
    places = lens.distort(direction).xy
    np.testing.assert_allclose(places, opencv_places(lens, direction), atol=1e-12)
    np.testing.assert_allclose(lens.undistort(places), direction, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: f"{lens.kind}{len(lens.coefficients)}")
def test_derivatives_are_those_of_the_places(lens: Lens) -> None:
    direction, step = np.concatenate([directions(1.2), [[0.0, 0.0], [1e-6, 0.0]]]), 1e-6
    found = lens.distort(direction)
    for k in range(2):
        moved = step * np.eye(2)[k]
        ends = [lens.distort(direction + sign * moved).xy for sign in (1, -1)]
        np.testing.assert_allclose(found.by_direction[:, :, k], (ends[0] - ends[1]) / (2 * step), atol=1e-8)
    columns = lens.by_coefficients(direction)
    for k in range(len(lens.coefficients)):
        changed = np.array([sign * step * np.eye(len(lens.coefficients))[k] for sign in (1, -1)])
        ends = [Lens(lens.kind, tuple(lens.coefficients + one)).distort(direction).xy for one in changed]
        np.testing.assert_allclose(columns[:, :, k], (ends[0] - ends[1]) / (2 * step), atol=1e-7)


@pytest.mark.parametrize(
    ("lens", "fold"),
    [
        (Lens("perspective", (-0.3, 0, 0, 0, 0)), 1 / np.sqrt(0.9)),
        (Lens("perspective", (0, 0, 0, 0, 0, -0.25, 0, 0)), 2.0),  # the pole
        (Lens("fisheye", (-0.5, 0, 0, 0)), np.tan(np.sqrt(1 / 1.5))),
        (Lens("fisheye", (0.1, 0, 0, 0)), np.inf),
    ],
)
def test_a_lens_ends_where_it_turns_back(lens: Lens, fold: float) -> None:
    assert lens.fold_radius == pytest.approx(fold)
    if np.isfinite(fold):
        radii = np.linspace(0, 0.999 * fold, 300)
        assert (np.diff(lens.distort(np.column_stack([radii, 0 * radii])).xy[:, 0]) > 0).all()
        largest = lens.distort(np.array([[0.9999 * fold, 0.0]])).xy[0, 0]
        if largest < 10:
            assert np.isnan(lens.undistort(np.array([[1.001 * largest, 0.0]]))).all()
