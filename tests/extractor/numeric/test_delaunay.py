"""The triangulation against an independent one.

Inside: the numbering of an image needs no more than most of the triangles, so that it hides a wrong one.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from extractor.numeric.delaunay import delaunay

Points = NDArray[np.float64]


def lattice(count: int, turn_deg: float = 7.0) -> Points:
    q, r = np.meshgrid(np.arange(count), np.arange(count))
    turn = np.radians(turn_deg)
    xy = 20.0 * np.stack([q + r / 2, r * 0.75**0.5], axis=-1).reshape(-1, 2)
    return xy @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])


def as_sets(faces: NDArray[np.int32]) -> set[tuple[int, ...]]:
    return {tuple(sorted(face)) for face in faces.tolist()}


def area(points: Points, faces: NDArray[np.int32]) -> float:
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return float(np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2)


def assert_neighbours(faces: NDArray[np.int32], across: NDArray[np.int32]) -> None:
    for f, k in np.argwhere(across >= 0):
        g = across[f, k]
        assert set(faces[f]) - {faces[f, k]} == set(faces[f]) & set(faces[g])
        assert f in across[g]


@pytest.mark.parametrize("seed", range(5))
def test_it_finds_the_same_triangles_as_qhull(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0, 640, (400, 2))
    faces, across = delaunay(points)
    expected = as_sets(Delaunay(points).simplices)
    assert as_sets(faces) <= expected
    assert len(expected) - len(faces) <= 4  # slivers along the hull
    assert_neighbours(faces, across)


def test_a_lattice_is_triangulated_whole_up_to_slivers_of_its_hull() -> None:
    points = lattice(20)
    faces, across = delaunay(points)
    assert len(faces) == 2 * 19 * 19
    assert area(points, faces) == pytest.approx(area(points, Delaunay(points).simplices), rel=1e-9)
    assert_neighbours(faces, across)


def test_points_on_common_circles_have_one_of_their_triangulations() -> None:
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    faces, across = delaunay(points)
    assert area(points, faces) == pytest.approx(121.0)
    assert len(faces) == 2 * 121
    assert_neighbours(faces, across)


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 2)),
        np.zeros((1, 2)),
        np.zeros((5, 2)),  # all at one place
        np.stack([np.arange(9.0), np.zeros(9)], axis=1),  # on a line along x
        np.stack([np.arange(9.0), 2 * np.arange(9.0)], axis=1),
    ],
)
def test_no_triangles_without_extent(points: Points) -> None:
    faces, across = delaunay(points)
    assert faces.shape == across.shape == (0, 3)


def test_of_points_at_one_place_one_is_used() -> None:
    points = lattice(6)
    faces, _ = delaunay(np.concatenate([points, points[7:9]]))
    once, _ = delaunay(points)
    assert len(faces) == len(once)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=3, max_size=40, unique=True),
    st.floats(1e-6, 1e6),
    st.floats(-1e6, 1e6),
)
def test_no_point_lies_in_another_triangles_circle(
    places: list[tuple[int, int]], scale: float, shift: float
) -> None:
    points = scale * np.array(places, np.float64) + shift
    faces, across = delaunay(points)
    assert_neighbours(faces, across)
    relative = (points - points.mean(axis=0)) / np.ptp(points, axis=0).max()
    for face in faces:
        a, b, c = relative[face]
        matrix = 2 * np.array([b - a, c - a])
        if abs(np.linalg.det(matrix)) < 1e-6:
            continue
        centre = a + np.linalg.solve(matrix, [(b - a) @ (b - a), (c - a) @ (c - a)])
        radius = np.linalg.norm(centre - a)
        assert (np.linalg.norm(relative - centre, axis=1) > radius * (1 - 1e-5) - 1e-7).all()
