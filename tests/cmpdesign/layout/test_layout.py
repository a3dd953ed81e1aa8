"""Layouts: counts, colors, orientation, invariants, sizes, clip outlines, speed."""

from __future__ import annotations

import doctest
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cmpdesign.design.design import Design
from cmpdesign.errors import DesignError
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.measures import cell_areas_mm2
from cmpdesign.layout.outline import rotation_matrix
from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.colors import BLACK, BLUE, GREEN, RED, WHITE
from cmpdesign.patterns.numbering import axial_from_layer

NAMES = list(registered_patterns())
TRIANGULAR = [name for name, pattern in registered_patterns().items() if pattern.graph.name == "triangular"]


def layout(pattern: str = "honeycomb", layers: int = 4, **more: object) -> Layout:
    return build_layout(Design(**{"pattern": pattern, "layers": layers, "pitch_mm": 1.5} | more))


def cells_around(built: Layout, marker: int) -> list[int]:
    """The cells that touch a marker, clockwise by the azimuth of their centres."""
    touching = np.flatnonzero((built.cell_corners == marker).any(axis=1))
    arms = built.marker_xy_mm[built.cell_corners[touching]].mean(axis=1) - built.marker_xy_mm[marker]
    return touching[np.argsort(-np.arctan2(arms[:, 1], arms[:, 0]))].tolist()


@pytest.mark.parametrize("pattern", TRIANGULAR)
@pytest.mark.parametrize("n", [1, 2, 3, 10, 31])
def test_counts_of_a_triangular_pattern(pattern: str, n: int) -> None:
    built = layout(pattern, n)
    assert len(built.marker_xy_mm) == 3 * n * (n + 1) + 1
    assert len(built.edges) == 9 * n * n + 3 * n
    assert len(built.cell_corners) == 6 * n * n
    colors = np.bincount(built.cell_color, minlength=5)
    assert colors[WHITE] == 1
    assert colors[[RED, GREEN, BLUE]].sum() == 3 * n * n
    assert colors[[RED, GREEN, BLUE]].tolist() == [n * n] * 3
    assert built.present.all()


@pytest.mark.parametrize("n", [1, 2, 9])
def test_counts_of_the_square_pattern(n: int) -> None:
    built = layout("square", n)
    side = 2 * n + 1
    assert len(built.marker_xy_mm) == (side + 1) ** 2
    assert len(built.cell_corners) == side * side
    assert len(built.edges) == 2 * side * (side + 1)
    assert np.bincount(built.cell_color, minlength=5)[[RED, WHITE]].tolist() == [
        1,
        (side * side + 1) // 2 - 1,
    ]
    assert built.present.all()


@pytest.mark.parametrize("pattern", NAMES)
@pytest.mark.parametrize("n", [1, 5])
def test_euler(pattern: str, n: int) -> None:
    built = layout(pattern, n)
    assert len(built.marker_xy_mm) - len(built.edges) + len(built.cell_corners) == 1


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_every_inner_marker_meets_red_green_blue_clockwise_between_three_others(pattern: str) -> None:
    built = layout(pattern, 5)
    inner = np.flatnonzero(built.marker_layer < 5)
    assert len(inner) == 61
    for marker in inner.tolist():
        colors = [int(built.cell_color[cell]) for cell in cells_around(built, marker)]
        start = colors.index(RED)
        turned = colors[start:] + colors[:start]
        assert turned[::2] == [RED, GREEN, BLUE]
        assert set(turned[1::2]) <= {BLACK, WHITE}


@pytest.mark.parametrize("pattern", TRIANGULAR)
def test_the_white_cell_stands_on_marker_0_between_three_colors(pattern: str) -> None:
    built = layout(pattern, 3)
    assert built.cell_color[built.reference_cell] == WHITE
    assert built.cell_corners[built.reference_cell].tolist() == [0, 2, 1]
    assert built.reference_marker == 0
    np.testing.assert_array_equal(built.marker_xy_mm[0], (0, 0))
    left, right = built.marker_xy_mm[1], built.marker_xy_mm[2]
    assert left[0] < 0 < right[0]
    assert left[1] == right[1] > 0
    white = set(built.cell_corners[built.reference_cell].tolist())
    sharing = [len(white & set(cell.tolist())) == 2 for cell in built.cell_corners]
    assert sorted(built.cell_color[sharing].tolist()) == [RED, GREEN, BLUE]


def test_the_square_pattern_reads_row_by_row() -> None:
    built = layout("square", 1)
    np.testing.assert_array_equal(built.marker_layer, np.repeat(range(4), 4))
    np.testing.assert_array_equal(built.marker_index, np.tile(range(4), 4))
    np.testing.assert_array_equal(built.marker_xy_mm[[0, 1, 4]], [(0, 0), (1.5, 0), (0, -1.5)])
    assert built.cell_corners[built.reference_cell].tolist() == [5, 9, 10, 6]
    assert (built.reference_marker, int(built.cell_color[built.reference_cell])) == (5, RED)
    assert built.cell_color.tolist() == [WHITE, BLACK, WHITE, BLACK, RED, BLACK, WHITE, BLACK, WHITE]


def test_honeycomb_positions_follow_the_axial_formula() -> None:
    built = layout("honeycomb", 6)
    q, r = axial_from_layer(built.marker_layer.astype(int), built.marker_index.astype(int))
    expected = 1.5 * np.stack([q + r / 2, r * np.sqrt(3) / 2], axis=-1)
    np.testing.assert_allclose(built.marker_xy_mm, expected, atol=5.1e-10)


@pytest.mark.parametrize("pattern", NAMES)
def test_edges_are_the_sides_of_the_cells_in_order(pattern: str) -> None:
    built = layout(pattern, 3)
    sides = set()
    for cell in built.cell_corners.tolist():
        sides |= {(min(a, b), max(a, b)) for a, b in zip(cell, cell[1:] + cell[:1], strict=True)}
    assert [tuple(edge) for edge in built.edges.tolist()] == sorted(sides)


def test_virtual_markers_divide_edges_from_the_smaller_id() -> None:
    built = layout("round", 3, virtual_per_edge=4)
    assert built.virtual_xy_mm.shape == (len(built.edges), 4, 2)
    for number in (0, 17, len(built.edges) - 1):
        a, b = built.marker_xy_mm[built.edges[number]]
        for j in range(4):
            np.testing.assert_allclose(built.virtual_xy_mm[number, j], a + (j + 1) / 5 * (b - a), atol=1e-12)
    assert layout(virtual_per_edge=0).virtual_xy_mm.shape == (len(layout().edges), 0, 2)


def test_ten_layers_with_five_virtual_markers_are_4981_points() -> None:
    built = layout(layers=10)
    assert len(built.marker_xy_mm) + built.virtual_xy_mm[..., 0].size == 4981


@pytest.mark.parametrize("pattern", NAMES)
@given(factor=st.floats(0.01, 50))
@settings(max_examples=15, deadline=None)
def test_scaling_scales_positions_and_nothing_else(pattern: str, factor: float) -> None:
    one, other = layout(pattern, pitch_mm=1), layout(pattern, pitch_mm=factor)
    np.testing.assert_allclose(other.marker_xy_mm, factor * one.marker_xy_mm, atol=1e-9 * (1 + factor))
    for column in ("marker_layer", "marker_index", "cell_corners", "cell_color", "edges"):
        np.testing.assert_array_equal(getattr(one, column), getattr(other, column))


@pytest.mark.parametrize("pattern", NAMES)
def test_mirroring_says_where_the_camera_is_and_moves_nothing(pattern: str) -> None:
    front, back = layout(pattern), layout(pattern, mirrored=True)
    assert (front.mirrored, back.mirrored) == (False, True)
    assert front.digest == back.digest


@pytest.mark.parametrize("pattern", NAMES)
@given(angle_deg=st.floats(-360, 360))
@settings(max_examples=15, deadline=None)
def test_rotation_is_counter_clockwise_about_marker_0(pattern: str, angle_deg: float) -> None:
    one, other = layout(pattern), layout(pattern, rotation_deg=angle_deg)
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    np.testing.assert_allclose(other.marker_xy_mm, one.marker_xy_mm @ [[c, s], [-s, c]], atol=1e-8)
    np.testing.assert_allclose(cell_areas_mm2(other), cell_areas_mm2(one), atol=1e-7)


def test_quarter_turns_are_exact() -> None:
    np.testing.assert_array_equal(rotation_matrix(90), [(0, -1), (1, 0)])
    np.testing.assert_array_equal(rotation_matrix(-90), [(0, 1), (-1, 0)])
    np.testing.assert_array_equal(rotation_matrix(180), [(-1, 0), (0, -1)])


@pytest.mark.parametrize("pattern", NAMES)
@pytest.mark.parametrize("angle_deg", [0, 60, 90, 180])
def test_no_negative_zeros_and_no_more_digits_than_stated(pattern: str, angle_deg: float) -> None:
    built = layout(pattern, 5, rotation_deg=angle_deg)
    for points in (built.marker_xy_mm, built.outline_mm):
        assert not np.signbit(points[points == 0]).any()
        np.testing.assert_array_equal(np.round(points, 9), points)


def test_a_layout_is_frozen() -> None:
    with pytest.raises(ValueError, match="read-only"):
        layout().marker_xy_mm[0, 0] = 1
    with pytest.raises(TypeError):
        layout().parameters["layers"] = 3  # type: ignore[index]


@pytest.mark.parametrize("pattern", NAMES)
@given(border_mm=st.floats(0, 5), angle_deg=st.sampled_from([0.0, 17.0]))
@settings(max_examples=10, deadline=None)
def test_the_outline_keeps_the_border_from_every_side(
    pattern: str, border_mm: float, angle_deg: float
) -> None:
    from shapely.geometry import Polygon

    built = layout(pattern, border_mm=border_mm, rotation_deg=angle_deg)
    outline = Polygon(built.outline_mm)
    assert outline.exterior.is_ccw
    cells = [Polygon(built.marker_xy_mm[cell]) for cell in built.cell_corners]
    nearest = min(cell.distance(outline.exterior) for cell in cells)
    assert nearest == pytest.approx(border_mm, abs=1e-7)


def test_the_overall_size_of_a_honeycomb_by_hand() -> None:
    width, height = layout("honeycomb", 10, border_mm=1).size_mm
    assert width == pytest.approx(2 * (15 + 1 / np.cos(np.radians(30))), abs=1e-8)
    assert height == pytest.approx(2 * (15 * np.sqrt(3) / 2 + 1), abs=1e-8)


@pytest.mark.parametrize("pattern", NAMES)
@given(
    width_mm=st.floats(8, 300),
    height_mm=st.one_of(st.none(), st.floats(8, 300)),
    layers=st.integers(1, 12),
    angle_deg=st.sampled_from([0.0, 30.0, 77.7]),
)
@settings(max_examples=25, deadline=None)
def test_overall_size_and_layers_give_the_largest_pitch(
    pattern: str, width_mm: float, height_mm: float | None, layers: int, angle_deg: float
) -> None:
    more = {"aspect": 0.7} if "aspect" in registered_patterns()[pattern].options else {}
    sizes = {"width_mm": width_mm, "height_mm": height_mm, "rotation_deg": angle_deg}
    built = build_layout(Design(pattern=pattern, layers=layers, **sizes, **more))
    width, height = built.size_mm
    slack = [width_mm - width] + ([] if height_mm is None else [height_mm - height])
    assert min(slack) == pytest.approx(0, abs=1e-8)
    assert min(slack) >= -1e-8


@pytest.mark.parametrize("pattern", NAMES)
@given(width_mm=st.floats(12, 200), pitch_mm=st.floats(1, 3))
@settings(max_examples=20, deadline=None)
def test_overall_size_and_pitch_give_as_many_layers_as_fit(
    pattern: str, width_mm: float, pitch_mm: float
) -> None:
    built = build_layout(Design(pattern=pattern, width_mm=width_mm, pitch_mm=pitch_mm))
    assert built.size_mm[0] <= width_mm + 1e-7
    assume(built.parameters["layers"] < 200)
    assert layout(pattern, built.parameters["layers"] + 1, pitch_mm=pitch_mm).size_mm[0] > width_mm - 1e-7


@pytest.mark.parametrize("pitch_mm", [1.5, 1.1, 1 / 3])
def test_a_size_that_just_fits_is_not_lost_to_rounding(pitch_mm: float) -> None:
    for n in range(1, 41):
        width_mm = pitch_mm * (2 * n + 1) + 2
        built = build_layout(Design(pattern="square", pitch_mm=pitch_mm, width_mm=width_mm))
        assert built.parameters["layers"] == n


@pytest.mark.parametrize("spacing", ["angle", "arc"])
def test_width_and_height_fix_an_ellipse(spacing: str) -> None:
    built = build_layout(Design(pattern="elliptical", layers=6, width_mm=19, height_mm=16, spacing=spacing))
    np.testing.assert_allclose(built.size_mm, (19, 16), atol=1e-8)


@pytest.mark.parametrize("pattern", NAMES)
@pytest.mark.parametrize("angle_deg", [0.0, 25.0])
@pytest.mark.parametrize("clip", ["rectangle", "circle"])
def test_clip_keeps_exactly_the_whole_cells_inside(pattern: str, angle_deg: float, clip: str) -> None:
    sizes = {"clip_width_mm": 14, "clip_height_mm": 11} if clip == "rectangle" else {"clip_diameter_mm": 13}
    whole = layout(pattern, 6, rotation_deg=angle_deg)
    cut = layout(pattern, 6, rotation_deg=angle_deg, clip=clip, **sizes)
    np.testing.assert_array_equal(cut.marker_xy_mm, whole.marker_xy_mm)
    centre = (cut.outline_mm.max(axis=0) + cut.outline_mm.min(axis=0)) / 2
    at = whole.marker_xy_mm - centre
    inside = np.hypot(*at.T) <= 5.5 if clip == "circle" else (np.abs(at) <= (6, 4.5)).all(axis=1)
    expected = [cell for cell in whole.cell_corners.tolist() if inside[cell].all()]
    assert 0 < len(expected) < len(whole.cell_corners)
    assert cut.cell_corners.tolist() == expected
    assert set(map(tuple, cut.edges.tolist())) < set(map(tuple, whole.edges.tolist()))
    assert sorted(set(cut.edges.ravel().tolist())) == sorted(set(cut.cell_corners.ravel().tolist()))
    seen = set(cut.cell_corners[cut.cell_color != BLACK].ravel().tolist())
    assert set(np.flatnonzero(cut.present).tolist()) == seen
    white_or_red = whole.cell_color[whole.reference_cell]
    assert cut.cell_color[cut.reference_cell] == white_or_red
    assert cut.reference_marker == whole.reference_marker


@pytest.mark.parametrize("pattern", NAMES)
def test_pitch_and_clip_give_as_many_layers_as_cover_it(pattern: str) -> None:
    sizes = {"clip": "rectangle", "clip_width_mm": 18.6, "clip_height_mm": 14.3, "rotation_deg": 10}
    built = build_layout(Design(pattern=pattern, pitch_mm=1, **sizes))
    layers = built.parameters["layers"]
    assert [_covers(pattern, n, built.outline_mm) for n in (layers - 1, layers, layers + 1)] == [
        False,
        True,
        True,
    ]
    more = layout(pattern, layers + 1, pitch_mm=1, **sizes)
    assert len(more.cell_corners) == len(built.cell_corners)


def _covers(pattern: str, layers: int, outline_mm: np.ndarray) -> bool:
    """Do that many layers, turned by 10 degrees, cover the outline less its border of 1 mm?"""
    from shapely.geometry import Polygon

    whole = layout(pattern, layers, pitch_mm=1, rotation_deg=10, border_mm=0)
    centre = [(p.max(axis=0) + p.min(axis=0)) / 2 for p in (whole.outline_mm, outline_mm)]
    window = (outline_mm - centre[1]) * (1 - 2 / np.array([18.6, 14.3])) + centre[0]
    return bool(Polygon(whole.outline_mm).covers(Polygon(window)))


def test_a_clip_without_reference_cell_is_refused() -> None:
    with pytest.raises(DesignError, match="reference"):
        layout(clip="circle", clip_diameter_mm=3)
    with pytest.raises(DesignError, match="around the reference cell"):
        layout(clip="circle", clip_diameter_mm=5.5)


@pytest.mark.parametrize(
    "sizes",
    [
        {"layers": 3, "width_mm": 2},
        {"pitch_mm": 5, "width_mm": 10},
        {"pitch_mm": 0.01, "clip": "circle", "clip_diameter_mm": 50},
    ],
)
def test_sizes_that_hold_no_pattern_say_why(sizes: dict[str, object]) -> None:
    with pytest.raises(DesignError, match="mm"):
        build_layout(Design(pattern="honeycomb", **sizes))


@pytest.mark.parametrize("ratio", [0.05, 20])
def test_an_ellipse_that_flat_is_refused(ratio: float) -> None:
    with pytest.raises(DesignError, match=r"no ellipse with an aspect of 0\.25 to 4"):
        build_layout(Design(pattern="elliptical", layers=3, width_mm=60, height_mm=60 * ratio))


@pytest.mark.parametrize("pattern", NAMES)
def test_200_layers_are_sound(pattern: str) -> None:
    built = layout(pattern, 200)
    assert len(built.marker_xy_mm) > 120_000
    assert cell_areas_mm2(built).min() > 0


def test_200_layers_take_less_than_500_mb() -> None:
    tracemalloc.start()
    try:
        layout("honeycomb", 200)
        assert tracemalloc.get_traced_memory()[1] < 500e6
    finally:
        tracemalloc.stop()


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = (
        "import cmpdesign, sys; print([m for m in ('numpy', 'pydantic', 'scipy', 'cv2') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_docstring_examples() -> None:
    import cmpdesign.design.design
    import cmpdesign.layout.checks
    import cmpdesign.layout.report
    import cmpdesign.units

    for module in (
        cmpdesign.layout.build,
        cmpdesign.design.design,
        cmpdesign.layout.checks,
        cmpdesign.layout.report,
        cmpdesign.units,
    ):
        outcome = doctest.testmod(module)
        assert outcome.attempted > 0
        assert outcome.failed == 0


def test_every_exported_name_is_there_whatever_was_imported_before() -> None:
    import cmpdesign.layout.report

    names = [name for name in cmpdesign.__all__ if name != "__version__"]
    assert "build_layout" in names
    for name in names:
        assert getattr(cmpdesign, name).__name__ == name
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        _ = cmpdesign.nothing_of_the_kind
