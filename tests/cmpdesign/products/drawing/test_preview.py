"""preview.png: the right colors at the right places, the same bytes each time."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cmpdesign.design.design import Design, load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns import registered_patterns
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.drawing.preview import LONG_SIDE_PX, MARGIN_PX, TITLE_PX, draw_preview, preview_png


def layout(pattern: str, **more: object) -> Layout:
    return build_layout(Design(pattern=pattern, layers=15, pitch_mm=1.5, **more))


@pytest.mark.parametrize("pattern", list(registered_patterns()))
def test_every_cell_has_its_color_at_its_centre(pattern: str) -> None:
    built = layout(pattern)
    image = draw_preview(built)
    scale = LONG_SIDE_PX / max(built.size_mm)
    left, top = built.outline_mm.min(axis=0)[0], built.outline_mm.max(axis=0)[1]
    centres = built.marker_xy_mm[built.cell_corners].mean(axis=1)
    columns, rows = ((centres - (left, top)) * (scale, -scale) + (MARGIN_PX, MARGIN_PX + TITLE_PX)).T
    found = image[np.floor(rows).astype(int), np.floor(columns).astype(int)]
    expected = [
        [int(built.palette[COLORS[color]][i : i + 2], 16) for i in (5, 3, 1)] for color in built.cell_color
    ]
    wrong = np.abs(found.astype(int) - expected).max(axis=1) > 2
    # Ids hide the centres of none but the smallest cells.
    assert wrong.mean() < 0.02


@pytest.mark.parametrize("name", ["tac3d", "gelsight-mini", "square"])
def test_the_png_is_deterministic_and_readable(name: str) -> None:
    built = build_layout(load_design(name))
    data = preview_png(built)
    assert data == preview_png(built)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(image, draw_preview(built))


def test_any_name_is_drawn_and_a_long_one_is_cut() -> None:
    for name in ("Größe µ 模式", "x" * 100, "%d"):
        draw_preview(build_layout(Design(pattern="honeycomb", layers=1, pitch_mm=1, name=name)))


@pytest.mark.parametrize("layers", [1, 40])
def test_the_smallest_and_a_large_pattern_are_drawn(layers: int) -> None:
    image = draw_preview(build_layout(Design(pattern="honeycomb", layers=layers, pitch_mm=1)))
    assert max(image.shape) < 1.2 * (LONG_SIDE_PX + 2 * MARGIN_PX)
