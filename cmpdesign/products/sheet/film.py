"""One pad for a film printer: the inks, and on clear film a white layer, with register marks, trim and bleed boxes."""

from __future__ import annotations

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.layout.layout import Layout
from cmpdesign.products.sheet.page import (
    FilledPolygons,
    Page,
    TextLine,
    fitted_size_mm,
    rectangle_points,
)
from cmpdesign.products.sheet.printed_pad import (
    HAIRLINE_MM,
    Points,
    bleed_outline,
    crop_mark_polygons,
    pad_items,
    page_from_layout,
    print_side,
)

# From the bleed to the page's edge: crop marks, register marks and text.
EDGE_MM = 16.0
REGISTER_MM = 6.0
TEXT_MM = 2.2
INK = "#000000"


def film_pages(design: Design, layout: Layout) -> list[Page]:
    """The pages: inks, and the white layer where the film is clear. Both have the same marks at the same places."""
    side, option = print_side(design), design.sheet
    edge = EDGE_MM + option.bleed_mm
    width, height = (side_mm + 2 * edge for side_mm in layout.size_mm)
    place = np.array([edge, edge])
    bleed = page_from_layout(bleed_outline(layout, option), layout, place, design)
    layers: list[list[FilledPolygons | TextLine]] = [pad_items(layout, place, design)]
    texts = [f"inks. {side.text}"]
    if side.film == "clear":
        # On a transfer sheet the order of layers turns over.
        order = "under the inks, so print it first" if design.print_mirror else "over the inks"
        texts = [f"1 of 2: {texts[0]}", f"2 of 2: full white where this page is black, {order}"]
        layers.append([FilledPolygons([bleed], INK, "white")])
    crop = crop_mark_polygons(layout, place, design)
    across, along = register_marks(width, height)
    marks = [
        FilledPolygons([*crop, *across], INK, "register-across"),
        FilledPolygons(along, INK, "register-along"),
    ]
    name = str(layout.parameters.get("name") or layout.pattern)
    lines = [f"{name}, {text}" for text in texts]
    size = fitted_size_mm(lines, width - 4.0, TEXT_MM)
    trim = rectangle_points(edge, edge, *layout.size_mm)
    printed = rectangle_points(*bleed.min(axis=0), *np.ptp(bleed, axis=0))
    return [
        Page(
            width,
            height,
            f"{name}, film",
            [*items, *marks, TextLine(line, 2.0, height - 2.0, size)],
            trim,
            printed,
        )
        for items, line in zip(layers, lines, strict=True)
    ]


def register_marks(width_mm: float, height_mm: float) -> tuple[list[Points], list[Points]]:
    """Crosses in the middle of the four edges of a page: their lines across the page, and along it."""
    half, line = REGISTER_MM / 2, HAIRLINE_MM / 2
    inside = half + 2.0
    centres = [
        (width_mm / 2, inside),
        (width_mm / 2, height_mm - inside - TEXT_MM),
        (inside, height_mm / 2),
        (width_mm - inside, height_mm / 2),
    ]
    return (
        [rectangle_points(x - half, y - line, 2 * half, 2 * line) for x, y in centres],
        [rectangle_points(x - line, y - half, 2 * line, 2 * half) for x, y in centres],
    )
