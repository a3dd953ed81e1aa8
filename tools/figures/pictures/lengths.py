"""Drawings of every length of a design file: docs/reference/design-files.md."""

from __future__ import annotations

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout

from .sketch import ACCENT, FAINT, INK, Sketch

BLACK_LAYER, CLEAR, SKIN, TOOL, SHEET, BURNT = (
    "#141414",
    "#e6f1f6",
    "#d9cdb8",
    "#cfd4da",
    "#f3efe4",
    "#f4b183",
)
RED = "#c8322d"


def figures() -> dict[str, bytes]:
    """File name -> SVG."""
    drawn = {
        "lengths-pattern.svg": pattern(),
        "lengths-laser.svg": laser(),
        "lengths-mold.svg": mold(),
    }
    return {name: sketch.text_of().encode() for name, sketch in drawn.items()}


def box(sketch: Sketch, left: float, bottom: float, right: float, top: float, fill: str, stroke: str) -> None:
    sketch.polygon([(left, bottom), (right, bottom), (right, top), (left, top)], fill, stroke)


def small(pitch_mm: float = 1.0) -> Layout:
    return build_layout(Design(pattern="honeycomb", layers=3, pitch_mm=pitch_mm, border_mm=0.6 * pitch_mm))


def pattern() -> Sketch:
    """A pattern with its border, its marks and its cut; a rectangular and a circular clip."""
    sketch = Sketch((860, 430), (-7.2, -5.3, 12.6, 4.6))
    layout = small()
    width, height = (side / 2 for side in layout.size_mm)
    box(sketch, -6.3, -4.65, 5.9, 4.2, SHEET, FAINT)
    sketch.cells(layout)
    sketch.length((0.0, 0.0), (1.0, 0.0), "pitch_mm", (1.15, 0.0), "start")
    sketch.length((0.5, -2.598), (0.5, -height), "border_mm", (0.75, -height - 0.42), "start")
    sketch.length((-width, 3.85), (width, 3.85), "width_mm", (0, 4.4))
    sketch.line((-width, 0), (-width, 3.85), FAINT, 1, "3 3")
    sketch.line((width, 0), (width, 3.85), FAINT, 1, "3 3")
    sketch.length((-5.9, -height), (-5.9, height), "height_mm", (-6.0, 0.35), "start")
    sketch.line((-5.9, height), (-1.5, height), FAINT, 1, "3 3")
    sketch.line((-5.9, -height), (-1.5, -height), FAINT, 1, "3 3")
    for x, y in ((-width - 0.9, -height - 0.1), (width + 0.9, -height - 0.1), (-width - 0.9, height + 0.1)):
        sketch.dot((x, y), 0.42 * sketch.scale, "#ffffff", INK)
    right = width + 0.9
    sketch.length(
        (right - 0.42, -height - 0.75), (right + 0.42, -height - 0.75), "diameter_mm", (right, -4.32)
    )
    sketch.length((width, -height + 0.6), (right - 0.42, -height + 0.6), "gap_mm", (right + 0.4, -2.1))
    texts = (
        "bleed_mm: how far the printed black goes beyond the pad's cut",
        "dot_gain_mm: how far the printed black spreads into a cell",
    )
    for place, text in enumerate(texts):
        sketch.text((-0.2, -4.8 - 0.3 * place), text, 12, ACCENT, bold=True)
    _clips(sketch)
    return sketch


def _clips(sketch: Sketch) -> None:
    layout = small(0.46)
    for y, name in ((2.2, "rectangle"), (-2.3, "circle")):
        sketch.cells(layout, (9.1, y))
        sketch.text((9.1, y - 1.8), f'clip = "{name}"', 12, FAINT)
    sketch.polygon([(8.0, 1.6), (10.2, 1.6), (10.2, 2.8), (8.0, 2.8)], "none", ACCENT, 2)
    sketch.length((8.0, 4.0), (10.2, 4.0), "clip_width_mm", (9.1, 4.35))
    sketch.length((11.1, 1.6), (11.1, 2.8), "clip_height_mm", (11.35, 1.2))
    sketch.turn((9.1, -2.3), 1.0, 0, 359.9, ACCENT)
    sketch.length((8.1, -0.55), (10.1, -0.55), "clip_diameter_mm", (9.1, -0.17))


def laser() -> Sketch:
    """The job on the bed, a cell with the beam's cut, a section through the sheet."""
    sketch = Sketch((860, 350), (0, -0.6, 17.2, 6.4))
    box(sketch, 0.4, 0.3, 5.4, 5.3, "#ffffff", INK)
    sketch.text((2.9, 5.75), "the bed", 13, INK, bold=True)
    box(sketch, 2.3, 1.9, 4.7, 3.9, SHEET, FAINT)
    sketch.text((3.5, 2.9), "the job", 12, FAINT)
    sketch.length((0.4, 2.9), (2.3, 2.9), "x_mm", (1.35, 3.25))
    sketch.length((3.5, 0.3), (3.5, 1.9), "y_mm", (3.65, 1.1), "start")
    _pocket(sketch)
    _section(sketch)
    return sketch


def _pocket(sketch: Sketch) -> None:
    """A cell from above: the cut around it, and lines of a pocket."""
    sketch.text((8.5, 5.75), "a cell from the front", 13, INK, bold=True)
    sketch.polygon([(6.3, 1.0), (10.7, 1.0), (8.5, 4.9)], BURNT, INK)
    for step in range(4):
        y = 1.6 + 0.62 * step
        reach = 1.75 - 0.355 * step
        sketch.line((8.5 - reach, y), (8.5 + reach, y), FAINT, 1.2)
    sketch.length((8.5, 1.6), (8.5, 2.22), "hatch_mm", (8.75, 1.9), "start")
    sketch.length((6.3, 0.55), (6.75, 0.55), "kerf_y_mm", (6.3, 0.1), "start")
    sketch.text(
        (6.9, 0.55), "of a cut that runs in x (kerf_x_mm: in y; kerf_mm: both)", 10.5, FAINT, anchor="start"
    )
    sketch.line((6.3, 1.0), (10.7, 1.0), RED, 9)


def _section(sketch: Sketch) -> None:
    """A section through two cavities."""
    sketch.text((14.3, 5.75), "a section", 13, INK, bold=True)
    box(sketch, 11.7, 1.5, 16.9, 3.4, BLACK_LAYER, INK)
    for left in (12.2, 14.6):
        sketch.polygon([(left, 3.4), (left + 1.7, 3.4), (left + 1.55, 2.0), (left + 0.15, 2.0)], BURNT)
    sketch.length((11.95, 2.0), (11.95, 3.4), "depth_mm", (11.3, 3.75), "start")
    sketch.length((13.9, 3.6), (14.6, 3.6), "minimum_web_mm", (14.3, 4.1))
    sketch.text((16.4, 1.1), "front above", 11, FAINT)


def mold() -> Sketch:
    """A section through the closed mold and a boss plate, and a corner from above."""
    sketch = Sketch((900, 535), (0.6, -3.3, 19.6, 7.95))
    _stack(sketch)
    _plate(sketch)
    _corner(sketch)
    return sketch


def _stack(sketch: Sketch) -> None:
    """Tray, layers, lid."""
    sketch.text((5.6, 7.5), "the mold in section", 14, INK, bold=True)
    sketch.polygon(
        [
            (1.2, 0.0),
            (10.4, 0.0),
            (10.4, 3.6),
            (9.2, 3.6),
            (9.2, 2.6),
            (8.6, 2.6),
            (8.6, 3.6),
            (7.9, 3.6),
            (7.9, 1.3),
            (2.2, 1.3),
            (2.2, 3.6),
            (1.2, 3.6),
        ],
        TOOL,
        INK,
    )
    box(sketch, 2.2, 1.3, 7.9, 3.6, CLEAR, FAINT)
    box(sketch, 2.2, 3.6, 7.9, 4.3, BLACK_LAYER, INK)
    for left in (2.8, 4.3, 5.8):
        sketch.polygon([(left, 3.6), (left + 0.8, 3.6), (left + 0.95, 4.3), (left - 0.15, 4.3)], RED)
    box(sketch, 2.2, 4.3, 7.9, 5.0, SKIN, FAINT)
    box(sketch, 1.2, 5.0, 10.4, 6.2, TOOL, INK)
    box(sketch, 5.0, 5.0, 5.2, 6.2, "#ffffff", INK)
    lengths = (
        (0.0, 1.3, "floor_mm"),
        (1.3, 3.6, "base_mm"),
        (3.6, 4.3, "marker_mm"),
        (4.3, 5.0, "cover_mm"),
        (5.0, 6.2, "plate_mm"),
    )
    for low, high, name in lengths:
        sketch.length((11.3, low), (11.3, high), name, (11.5, (low + high) / 2), "start")
    sketch.length((7.9, 3.9), (8.6, 3.9), "parting_mm", (7.95, 4.62), "start")
    sketch.length((8.6, 2.35), (9.2, 2.35), "moat_mm", (8.9, 1.95))
    sketch.length((8.9, 2.6), (8.9, 3.6), "moat_depth_mm", (9.25, 3.1), "start")
    sketch.length((9.2, 0.5), (10.4, 0.5), "wall_mm", (9.1, 0.5), "end")
    sketch.length((3.75, 4.48), (4.15, 4.48), "gap_mm", (3.95, 4.78))
    sketch.length((5.0, 6.4), (5.2, 6.4), "vent_mm", (5.1, 6.8))
    sketch.text((5.0, -0.45), "the camera looks from below, through the clear base layer", 12, FAINT)
    sketch.text(
        (1.2, -0.95),
        "crown_radius_mm: radius of every surface of a domed pad",
        12,
        ACCENT,
        anchor="start",
        bold=True,
    )


def _plate(sketch: Sketch) -> None:
    """One boss with its plate, and the stencil."""
    sketch.text((15.4, 7.5), "a boss plate, a stencil", 14, INK, bold=True)
    box(sketch, 13.4, 5.9, 17.4, 6.8, TOOL, INK)
    for left in (14.0, 15.9):
        sketch.polygon([(left, 5.9), (left + 1.1, 5.9), (left + 0.95, 4.9), (left + 0.15, 4.9)], TOOL, INK)
    sketch.length((14.15, 4.65), (14.95, 4.65), "minimum_feature_mm", (14.6, 4.3))
    sketch.length((17.65, 5.9), (17.65, 6.8), "plate_mm", (17.85, 6.35), "start")
    box(sketch, 13.4, 2.9, 14.05, 3.3, TOOL, INK)
    box(sketch, 15.05, 2.9, 15.95, 3.3, TOOL, INK)
    box(sketch, 16.95, 2.9, 17.4, 3.3, TOOL, INK)
    sketch.length((17.65, 2.9), (17.65, 3.3), "stencil_mm", (17.85, 3.1), "start")
    sketch.text((15.4, 2.45), "a stencil's opening is larger than", 11, FAINT)
    sketch.text((15.4, 2.05), "the cavity by clearance_mm, each side", 11, ACCENT, bold=True)


def _corner(sketch: Sketch) -> None:
    """A corner of a part and the tip of a boss, from above."""
    sketch.polygon(
        [(13.4, -2.9), (13.4, 0.7), (13.55, 1.15), (13.95, 1.3), (17.4, 1.3), (17.4, -2.9)], TOOL, INK
    )
    sketch.text((15.4, 1.6), "a part from above", 12, FAINT)
    sketch.dot((14.7, 0.0), 0.5 * sketch.scale, "#ffffff", INK)
    sketch.dot((14.7, 0.0), 0.4 * sketch.scale, "#adb5bd", INK)
    sketch.length((14.3, -0.75), (15.1, -0.75), "pin_diameter_mm", (14.7, -1.1))
    sketch.text((15.4, 0.1), "hole: clearance_mm more", 11, ACCENT, anchor="start", bold=True)
    sketch.arrow((13.0, 1.6), (13.5, 1.15), ACCENT, 1.2)
    sketch.text((12.95, 1.8), "fillet_mm", 12, ACCENT, anchor="middle", bold=True)
    sketch.polygon([(15.4, -2.3), (16.6, -2.3), (16.07, -1.38), (15.93, -1.38)], RED)
    sketch.arrow((15.2, -1.5), (15.9, -1.38), ACCENT, 1.2)
    sketch.text((15.15, -1.6), "tip_radius_mm", 12, ACCENT, anchor="end", bold=True)
