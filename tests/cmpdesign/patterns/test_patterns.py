"""Every registered pattern: valid cells at every legal shape, and the embedding that it promises."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from shapely import union_all
from shapely.geometry import Polygon

from cmpdesign.design.design import ASPECT_MAX, ASPECT_MIN
from cmpdesign.patterns import Pattern, PatternShape, register_pattern, registered_patterns
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS, GraphFamily

ALL = list(registered_patterns().values())
SHAPES = st.builds(
    PatternShape,
    layers=st.integers(1, 40),
    aspect=st.floats(ASPECT_MIN, ASPECT_MAX),
    spacing=st.sampled_from(["angle", "arc"]),
)


def positions(pattern: Pattern, shape: PatternShape) -> np.ndarray:
    mesh = pattern.graph.make_graph(shape.layers)
    return pattern.positions(mesh.layer, mesh.index, shape)


def areas(xy: np.ndarray, corners: np.ndarray) -> np.ndarray:
    x, y = np.moveaxis(xy[corners], -1, 0)
    return (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2


def rim_area(pattern: Pattern, shape: PatternShape) -> float:
    return float(
        areas(
            pattern.positions(*pattern.graph.rim(shape.layers), shape),
            np.arange(len(pattern.graph.rim(shape.layers)[0]))[None],
        )[0]
    )


def test_the_four_patterns_are_registered() -> None:
    assert {"honeycomb", "round", "elliptical", "square"} <= set(registered_patterns())


@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.name)
def test_a_pattern_says_what_it_is_and_draws_itself(pattern: Pattern) -> None:
    assert pattern.summary
    assert "::" in (pattern.positions.__doc__ or "")


@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.name)
@settings(max_examples=60, deadline=None)
@given(shape=SHAPES)
def test_no_cell_is_inverted_and_none_overlap(pattern: Pattern, shape: PatternShape) -> None:
    xy = positions(pattern, shape)
    np.testing.assert_array_equal(xy[0], (0, 0))
    area = areas(xy, pattern.graph.make_graph(shape.layers).corners)
    assert area.min() > 0
    # Counter-clockwise cells that fill the rim's polygon exactly have no room to overlap: every point inside
    # is covered as often as the rim winds around it, which is once.
    assert area.sum() == pytest.approx(rim_area(pattern, shape), rel=1e-9)


@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.name)
@pytest.mark.parametrize("spacing", ["angle", "arc"])
@pytest.mark.parametrize("aspect", [ASPECT_MIN, 1.0, ASPECT_MAX])
def test_the_union_of_the_cells_has_the_sum_of_their_areas(
    pattern: Pattern, spacing: str, aspect: float
) -> None:
    shape = PatternShape(4, aspect, spacing)
    xy, corners = positions(pattern, shape), pattern.graph.make_graph(4).corners
    union = union_all([Polygon(xy[cell]) for cell in corners], grid_size=1e-10)
    assert union.area == pytest.approx(areas(xy, corners).sum(), rel=1e-7)


@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.name)
@given(shape=SHAPES)
@settings(max_examples=25, deadline=None)
def test_the_rim_is_convex_and_counter_clockwise(pattern: Pattern, shape: PatternShape) -> None:
    rim = pattern.positions(*pattern.graph.rim(shape.layers), shape)
    side = np.roll(rim, -1, axis=0) - rim
    turn = side[:, 0] * np.roll(side[:, 1], -1) - side[:, 1] * np.roll(side[:, 0], -1)
    assert turn.min() > -1e-9
    mesh = pattern.graph.make_graph(shape.layers)
    assert set(zip(*pattern.graph.rim(shape.layers), strict=True)) <= set(
        zip(mesh.layer, mesh.index, strict=True)
    )


def test_honeycomb_edges_are_one_pitch_long() -> None:
    xy, corners = (
        positions(registered_patterns()["honeycomb"], PatternShape(7)),
        registered_patterns()["honeycomb"].graph.make_graph(7).corners,
    )
    sides = xy[corners] - xy[np.roll(corners, 1, axis=1)]
    np.testing.assert_allclose(np.hypot(sides[..., 0], sides[..., 1]), 1, atol=1e-13)


def test_round_markers_lie_on_circles_at_equal_angles() -> None:
    mesh = TRIANGULAR_GRAPHS.make_graph(5)
    xy = positions(registered_patterns()["round"], PatternShape(5))
    np.testing.assert_allclose(np.hypot(*xy.T), mesh.layer, atol=1e-13)
    for layer in range(1, 6):
        angle = np.degrees(np.unwrap(np.arctan2(*xy[mesh.layer == layer].T[::-1])))
        np.testing.assert_allclose(angle, 120 - 60 * np.arange(6 * layer) / layer, atol=1e-9)


def test_an_ellipse_with_aspect_1_is_round_in_both_spacings() -> None:
    expected = positions(registered_patterns()["round"], PatternShape(6))
    for spacing in ("angle", "arc"):
        np.testing.assert_allclose(
            positions(registered_patterns()["elliptical"], PatternShape(6, 1.0, spacing)),
            expected,
            atol=1e-12,
        )


def test_equal_parameter_angles_are_the_round_pattern_stretched() -> None:
    stretched = positions(registered_patterns()["round"], PatternShape(6)) * (1, 0.4)
    np.testing.assert_allclose(
        positions(registered_patterns()["elliptical"], PatternShape(6, 0.4)), stretched, atol=1e-12
    )


@pytest.mark.parametrize("aspect", [ASPECT_MIN, 0.7, 1.6, ASPECT_MAX])
def test_equal_arc_length_by_numerical_integration(aspect: float) -> None:
    mesh = TRIANGULAR_GRAPHS.make_graph(3)
    xy = positions(registered_patterns()["elliptical"], PatternShape(3, aspect, "arc"))[mesh.layer == 3] / 3
    np.testing.assert_allclose(xy[:, 0] ** 2 + (xy[:, 1] / aspect) ** 2, 1, atol=1e-12)
    angle = np.unwrap(np.arctan2(xy[:, 1] / aspect, xy[:, 0]))

    def arc(start: float, end: float) -> float:
        return float(quad(lambda t: np.hypot(np.sin(t), aspect * np.cos(t)), start, end, epsabs=1e-12)[0])

    perimeter = arc(0, 2 * np.pi)
    steps = [arc(b, a) for a, b in pairwise(angle)]
    np.testing.assert_allclose(steps, perimeter / 18, rtol=1e-9)
    assert arc(0, angle[0]) == pytest.approx(perimeter / 3, rel=1e-9)


def test_a_name_is_taken_once() -> None:
    graph: GraphFamily = TRIANGULAR_GRAPHS
    with pytest.raises(ValueError, match="registered twice"):
        register_pattern("honeycomb", graph)(registered_patterns()["honeycomb"].positions)
