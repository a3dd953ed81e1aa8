"""Dense fields: exact for fields of their order, smooth across edges, converging, empty where no marker is known."""

from __future__ import annotations

import numpy as np
import pytest

from extractor import Field
from tests.support.view_scenes import pressed, reference


def quadratic(xy: np.ndarray) -> np.ndarray:
    x, y = xy.T
    return np.column_stack([1 + 2 * x - y + 0.1 * x * x - 0.2 * x * y, 0.3 * y * y - x])


def inside(field: Field, count: int, seed: int = 0) -> np.ndarray:
    """(count, 2) random places within the pattern."""
    rng = np.random.default_rng(seed)
    corners = field.xy_mm[field.triangles[rng.integers(0, len(field.triangles), count)]]
    return np.einsum("ni,nid->nd", rng.dirichlet([1, 1, 1], count), corners)


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical", "square"])
def test_planes_and_quadratics_are_exact(pattern: str) -> None:
    field = Field(reference(pattern))
    places = inside(field, 400)
    np.testing.assert_allclose(field.at(quadratic(field.xy_mm), places), quadratic(places), atol=1e-9)
    plane = field.xy_mm @ [[1.0, 2.0], [3.0, -1.0]] + 5
    np.testing.assert_allclose(
        field.at(plane, places, smooth=False), places @ [[1.0, 2.0], [3.0, -1.0]] + 5, atol=1e-9
    )


def test_markers_keep_their_values() -> None:
    field, rng = Field(reference("round")), np.random.default_rng(1)
    values = rng.normal(size=(len(field.xy_mm), 3))
    for smooth in (True, False):
        np.testing.assert_allclose(field.at(values, field.xy_mm * (1 - 1e-9), smooth), values, atol=1e-6)


def test_the_tangent_plane_is_continuous_across_edges() -> None:
    """Rough values, so that a jump would show; linear interpolation, which has one, shows it."""
    field, rng = Field(reference()), np.random.default_rng(2)
    values = rng.normal(size=(len(field.xy_mm), 1))
    shared = np.sort(field.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, counts = np.unique(shared, axis=0, return_counts=True)
    a, b = field.xy_mm[pairs[counts == 2]].transpose(1, 0, 2)
    at = a + rng.uniform(0.1, 0.9, (len(a), 1)) * (b - a)
    across = np.column_stack([-(b - a)[:, 1], (b - a)[:, 0]]) / np.linalg.norm(b - a, axis=1)[:, None]
    step = 1e-5

    def kink(smooth: bool) -> float:
        here, near, far = (field.at(values, at + k * step * across, smooth) for k in (1e-6, 1, -1))
        return float(np.abs(near - 2 * here + far).max() / step)

    assert kink(True) < 1e-3 < 0.1 < kink(False)


def test_the_parts_of_a_triangle_meet_smoothly() -> None:
    field, rng = Field(reference()), np.random.default_rng(3)
    values = rng.normal(size=(len(field.xy_mm), 1))
    corners = field.xy_mm[field.triangles]
    middle = corners.mean(axis=1)
    at = middle + 0.4 * (corners[:, 0] - middle)
    step = 1e-5
    for direction in ((1.0, 0.3), (-0.2, 1.0)):
        ends = [field.at(values, at + k * step * np.array(direction)) for k in (-1, 0, 1)]
        assert np.abs(ends[0] - 2 * ends[1] + ends[2]).max() / step < 1e-3


def test_it_converges_faster_than_linear_interpolation() -> None:
    errors = {True: [], False: []}
    for layers, scale in ((5, 1.0), (10, 0.5)):
        field = Field(reference(layers=layers))
        places = inside(field, 500) * 0.7
        for smooth, found in errors.items():
            away = field.at(pressed(scale * field.xy_mm), places, smooth) - pressed(scale * places)
            found.append(np.sqrt(np.mean(away**2)))
    assert errors[True][0] / errors[True][1] > 6  # the third power of the edge or better
    assert 3 < errors[False][0] / errors[False][1] < 5.5
    assert errors[True][0] < 0.3 * errors[False][0]


def test_what_is_not_known_is_not_invented() -> None:
    field = Field(reference())
    values = quadratic(field.xy_mm)
    values[7] = np.nan
    places = inside(field, 500)
    around = (field.triangles[field.find(places)[0]] == 7).any(axis=1)
    for smooth in (True, False):
        found = field.at(values, places, smooth)
        assert np.isnan(found[around]).all() and np.isfinite(found[~around]).all() and around.any()
    np.testing.assert_allclose(field.at(values, places)[~around], quadratic(places)[~around], atol=1e-9)
    assert np.isnan(field.at(values, np.array([[100.0, 0.0], [0.0, 30.0]]))).all()


def test_a_scrap_of_markers_has_planes_or_nothing() -> None:
    field = Field(reference())
    values = np.full((len(field.xy_mm), 1), np.nan)
    values[[0, 1, 2]] = field.xy_mm[[0, 1, 2], :1]
    gradient = field.gradients(values)
    np.testing.assert_allclose(gradient[0, 0], [1, 0], atol=1e-9)
    assert np.isnan(gradient[5:]).all()
    values[2] = np.nan
    assert np.isnan(field.gradients(values)).all()


def test_normals_point_out_of_the_front() -> None:
    field = Field(reference())
    flat = np.column_stack([field.xy_mm, np.zeros(len(field.xy_mm))])
    np.testing.assert_allclose(field.normals(flat), np.tile([0.0, 0, 1], (len(flat), 1)), atol=1e-12)
    tilted = flat @ np.array([[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]])
    np.testing.assert_allclose(field.normals(tilted)[3], [0.6, 0, 0.8], atol=1e-12)
