"""Coverage is exact: against polygon clipping, against quadrature of the point spread, twin against twin."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import erf, ndtr

from cmpdesign.scene.drawing.coverage import Engine, draw_coverage
from cmpdesign.scene.drawing.paths import CHORD_PX, PolygonSegments, join_segments, project_polygons
from cmpdesign.scene.parts.optics import box_gaussian, make_point_spread

WIDTH, HEIGHT = SIZE = (23, 17)
Points = NDArray[np.float64]
ENGINES: tuple[Engine, ...] = ("compiled", "numpy")

coordinates = st.floats(-60, 80, allow_nan=False)
corners = st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=3)


def closed(points: Points) -> PolygonSegments:
    sides = np.concatenate([points, np.roll(points, -1, axis=0)], axis=1)
    return PolygonSegments(sides, np.zeros(len(points), dtype=np.int64))


def one(points: Points, blur_px: float, engine: Engine, size: tuple[int, int] = SIZE) -> Points:
    return draw_coverage(closed(points), np.ones((1, 1)), size, make_point_spread(blur_px), engine)[0].astype(
        np.float64
    )


def clipped_areas(points: Points) -> Points:
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    boxes = shapely.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5)
    return shapely.area(shapely.intersection(boxes, shapely.Polygon(points)))


def quadrature(points: Points, blur_px: float, size: tuple[int, int]) -> Points:
    """A convex polygon seen through box * Gaussian, by integrating row after row of its interior."""
    low, high = points[:, 1].min(), points[:, 1].max()
    # Panels end at the corners, where the width has kinks.
    knots = np.unique(np.concatenate([np.linspace(low, high, 400), points[:, 1]]))
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middle, half = 0.5 * (knots[1:] + knots[:-1]), 0.5 * np.diff(knots)
    y = (middle[:, None] + half[:, None] * nodes).ravel()
    dy = (half[:, None] * weights).ravel()
    start, end = points, np.roll(points, -1, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (y[:, None] - start[:, 1]) / (end - start)[:, 1]
        x = np.where((t >= 0) & (t <= 1), start[:, 0] + t * (end - start)[:, 0], np.nan)
    left, right = np.nanmin(x, axis=1), np.nanmax(x, axis=1)
    columns = np.arange(size[0])[:, None]
    seen = edge_response(columns - left, blur_px) - edge_response(columns - right, blur_px)
    rows = box_gaussian(np.arange(size[1])[:, None] - y, blur_px)
    return (rows * dy) @ seen.T


def edge_response(distance: Points, blur_px: float) -> Points:
    """Integral of ``box_gaussian`` from -inf: the value of a pixel ``distance`` inside a half plane."""

    def ramp(z: Points) -> Points:
        return z * ndtr(z) + np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)

    return blur_px * (ramp((distance + 0.5) / blur_px) - ramp((distance - 0.5) / blur_px))


@pytest.mark.parametrize("engine", ENGINES)
@settings(max_examples=60, deadline=None)
@given(triangle=corners)
def test_unblurred_coverage_is_the_clipped_area(engine: Engine, triangle: list[tuple[float, float]]) -> None:
    points = np.array(triangle)
    np.testing.assert_allclose(one(points, 0, engine), clipped_areas(points), atol=2e-5)


@settings(max_examples=30, deadline=None)
@given(triangle=corners, blur_px=st.sampled_from([0.3, 0.8, 1.0, 2.5]))
def test_the_two_engines_agree(triangle: list[tuple[float, float]], blur_px: float) -> None:
    points = np.array(triangle)
    np.testing.assert_allclose(one(points, blur_px, "compiled"), one(points, blur_px, "numpy"), atol=5e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("blur_px", [0.3, 0.6, 1.0, 1.5, 2.5])
def test_blurred_corners_match_quadrature(engine: Engine, blur_px: float) -> None:
    points = np.array([[4.31, 2.17], [18.83, 5.46], [9.27, 14.09]])
    np.testing.assert_allclose(
        one(points, blur_px, engine), quadrature(points, blur_px, SIZE), atol=1e-4 if blur_px >= 0.6 else 3e-4
    )


@pytest.mark.parametrize("blur_px", [0.1, 0.2, 0.35, 0.5, 0.61, 0.79, 1.0, 1.19, 1.2, 1.7, 2.5, 5.0, 20.0])
def test_an_edge_is_where_it_should_be(blur_px: float) -> None:
    size = (int(30 + 14 * blur_px), 3)
    middle = size[0] / 2
    columns = np.arange(size[0])
    slope = box_gaussian(columns - middle, blur_px)
    for phase in np.linspace(-0.5, 0.5, 11):
        left = middle + phase
        points = np.array([[left, -500.0], [left + 5000, -500], [left + 5000, 500], [left, 500]])
        row = one(points, blur_px, "compiled", size)[1]
        error = row - edge_response(columns - left, blur_px)
        assert np.abs(error).max() < 5e-4
        slope = box_gaussian(columns - left, blur_px)
        assert abs(error @ slope / (slope @ slope)) < 2e-4  # px, as least squares would see it


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("blur_px", [0, 0.4, 1.0, 2.0])
def test_area_and_centroid_are_conserved(engine: Engine, blur_px: float) -> None:
    points = np.array([[22.4, 20.1], [41.2, 23.9], [30.8, 38.3]])
    image = one(points, blur_px, engine, (64, 60))
    along, across = points[1] - points[0], points[2] - points[0]
    assert image.sum() == pytest.approx(0.5 * (along[0] * across[1] - along[1] * across[0]), rel=1e-5)
    x = (image.sum(axis=0) @ np.arange(64)) / image.sum()
    y = (image.sum(axis=1) @ np.arange(60)) / image.sum()
    # The bare box forgets where inside a pixel the shape lies; a spline's first moment does not.
    tolerance = 1e-3 if blur_px == 0 else 1e-4
    assert (x, y) == pytest.approx(tuple(points.mean(axis=0)), abs=tolerance)


def test_either_orientation_counts_as_covered() -> None:
    points = np.array([[4.3, 2.1], [18.8, 5.4], [9.2, 14.0]])
    np.testing.assert_allclose(one(points, 1.0, "compiled"), one(points[::-1], 1.0, "compiled"), atol=1e-6)


def test_neighbours_fill_their_common_edge() -> None:
    square = np.array([[-50.0, -50.0], [80, -50], [80, 80], [-50, 80]])
    halves = join_segments([closed(square[[0, 1, 2]]), closed(square[[0, 2, 3]])])
    image = draw_coverage(halves, np.ones((2, 1)), SIZE, make_point_spread(1.0))
    np.testing.assert_allclose(image, 1.0, atol=2e-6)


def test_bands_join_without_a_seam() -> None:
    points = np.array([[-30.0, -20.0], [70.0, 60.0], [10.0, 300.0]])
    tall = one(points, 1.0, "compiled", (40, 200))
    shifted = one(points - [0, 37.0], 1.0, "compiled", (40, 163))
    np.testing.assert_allclose(tall[37:], shifted, atol=2e-6)


def test_chords_stay_on_the_curve() -> None:
    def swirl(xy: Points) -> Points:
        angle = 3 * np.exp(-((xy / 40) ** 2).sum(axis=1))
        x, y = xy.T
        return np.stack(
            [np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], axis=-1
        )

    polygon = np.array([[[-60.0, -35.0], [55.0, -20.0], [10.0, 48.0]]])
    curve = project_polygons(polygon, swirl, curved=True)
    chords = shapely.LineString(np.vstack([curve.xy_px[:, :2], curve.xy_px[-1:, 2:]]))
    t = np.linspace(0, 1, 4001)[:, None]
    ends = zip(polygon[0], np.roll(polygon[0], -1, axis=0), strict=True)
    true = np.concatenate([swirl(start + t * (end - start)) for start, end in ends])
    assert shapely.distance(shapely.points(true), chords).max() < 1.25 * CHORD_PX
    assert len(curve.xy_px) < 3000


def test_the_reference_itself() -> None:
    """The quadrature of the tests gives the closed form for a half plane."""
    points = np.array([[6.3, -60.0], [90.0, -60.0], [90.0, 60.0], [6.3, 60.0]])
    seen = quadrature(points, 1.3, (20, 1))[0]
    x = np.arange(20) - 6.3
    fine = np.linspace(-0.5, 0.5, 2001)
    closed_form = (0.5 + 0.5 * erf((x[:, None] + fine) / (1.3 * np.sqrt(2)))).mean(axis=1)
    np.testing.assert_allclose(seen, closed_form, atol=1e-4)
