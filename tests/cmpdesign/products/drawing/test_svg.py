"""pattern.svg, read again by svgelements."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
import svgelements

from cmpdesign.design.design import Design, load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.drawing.svg import layout_to_svg, scale_length_mm

# svgelements converts the sheet's mm to pixels of 1/96 inch and takes 1 mm for 0.0393701 inch.
PX_PER_MM = 96 * 0.0393701


def layout(pattern: str = "honeycomb", layers: int = 3, **more: object) -> Layout:
    return build_layout(Design(pattern=pattern, layers=layers, pitch_mm=1.5, **more))


def read(text: str) -> dict[str, list[tuple[str, np.ndarray]]]:
    """Group id -> (fill, corner points in mm on the sheet) of every path."""
    document = svgelements.SVG.parse(io.StringIO(text), ppi=96, reify=True)
    groups = {}
    for group in document.select(lambda e: isinstance(e, svgelements.Group) and e.id in COLORS):
        groups[group.id] = [(path.fill.hex, corners_mm(path)) for path in group]
    return groups


def corners_mm(path: svgelements.Path) -> np.ndarray:
    assert isinstance(path[0], svgelements.Move)
    assert isinstance(path[-1], svgelements.Close)
    return np.array([(p.end.x, p.end.y) for p in path[:-1]]) / PX_PER_MM


@pytest.mark.parametrize("pattern", list(registered_patterns()))
def test_every_cell_is_where_the_layout_says(pattern: str) -> None:
    built = layout(pattern, rotation_deg=11)
    groups = read(layout_to_svg(built))
    assert set(groups) == set(COLORS)
    top_left = built.outline_mm.min(axis=0)[0], built.outline_mm.max(axis=0)[1]
    for color, name in enumerate(COLORS):
        polygons = (
            [built.outline_mm]
            if color == BLACK
            else built.marker_xy_mm[built.cell_corners[built.cell_color == color]]
        )
        assert len(groups[name]) == len(polygons)
        for (fill, points), polygon in zip(groups[name], polygons, strict=True):
            assert fill == built.palette[name]
            np.testing.assert_allclose(points, (polygon - top_left) * (1, -1), rtol=0, atol=1e-6)


def test_the_sheet_is_the_outline_in_mm() -> None:
    built = layout("round")
    text = layout_to_svg(built)
    width, height = built.size_mm
    assert f'width="{width}mm"' in text
    assert f'height="{height}mm"' in text
    assert f'viewBox="0 0 {width} {height}"' in text
    every = np.concatenate([points for paths in read(text).values() for _, points in paths])
    np.testing.assert_allclose([every.min(axis=0), every.max(axis=0)], [(0, 0), (width, height)], atol=1e-6)


def test_the_ground_comes_first_and_nothing_is_transformed_or_extra() -> None:
    text = layout_to_svg(layout())
    assert re.findall(r'<g [^>]*id="(\w+)"', text)[0] == "black"
    assert sorted(re.findall(r'id="(\w+)"', text)) == sorted(COLORS)
    for word in ("transform", "<text", "<rect", "<circle", "e-"):
        assert word not in text.split("</title>")[1]


def test_it_is_deterministic() -> None:
    assert layout_to_svg(layout()) == layout_to_svg(layout())


def test_mirror_swaps_left_and_right() -> None:
    built = layout()
    plain, mirrored = read(layout_to_svg(built)), read(layout_to_svg(built, mirror=True))
    for name in COLORS:
        for (_, points), (_, other) in zip(plain[name], mirrored[name], strict=True):
            np.testing.assert_allclose(other, points * (-1, 1) + (built.size_mm[0], 0), atol=1e-6)


@pytest.mark.parametrize("mirror", [False, True])
def test_print_extras(mirror: bool) -> None:
    built = layout(clip="circle", clip_diameter_mm=9)
    text = layout_to_svg(built, ids=True, scale=True, mirror=mirror)
    ids = re.search(r'<g [^>]*id="ids".*?</g>', text)
    assert ids is not None
    assert sorted(map(int, re.findall(r">(\d+)</text>", ids[0]))) == np.flatnonzero(built.present).tolist()
    bar = re.search(r'<rect height="0.4" width="([\d.]+)"', text)
    assert bar is not None
    assert float(bar[1]) == 2.0
    for name, paths in read(text).items():
        for (_, points), (_, plain) in zip(
            paths, read(layout_to_svg(built, mirror=mirror))[name], strict=True
        ):
            np.testing.assert_allclose(points, plain, atol=1e-6)


@pytest.mark.parametrize(
    ("width_mm", "bar_mm"), [(3.9, 1), (4, 2), (10, 5), (32.3, 10), (40, 20), (399, 100)]
)
def test_the_scale_bar_is_a_round_length(width_mm: float, bar_mm: float) -> None:
    assert scale_length_mm(width_mm) == bar_mm


def test_names_are_escaped() -> None:
    text = layout_to_svg(build_layout(load_design("honeycomb", {"name": "<a & b>", "layers": "1"})))
    assert "&lt;a &amp; b&gt;" in text
