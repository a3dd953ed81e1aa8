"""The drawings of docs/reference/conventions.md. Ids, colors and positions come from real layouts."""

from __future__ import annotations

import numpy as np

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.patterns.colors import BLACK

from .sketch import ACCENT, FAINT, INK, Sketch

WHITE, YELLOW = "#ffffff", "#ffe94a"


def figures() -> dict[str, bytes]:
    """File name -> SVG."""
    drawn = {
        "frames.svg": frames(),
        "pixel-centre.svg": pixel_centre(),
        "numbering.svg": numbering(),
        "colors.svg": colors(),
        "edges.svg": edges(),
    }
    return {name: sketch.text_of().encode() for name, sketch in drawn.items()}


def small(layers: int, border_mm: float = 0.35) -> Layout:
    """A honeycomb layout with a pitch of 1 mm."""
    return build_layout(Design(pattern="honeycomb", layers=layers, pitch_mm=1.0, border_mm=border_mm))


def frames() -> Sketch:
    """The layout frame beside the image frame, with the same pattern in both."""
    sketch = Sketch((760, 330), (-3.2, -3.05, 11.5, 3.33))
    layout = small(2)
    sketch.cells(layout)
    sketch.text((0, 2.95), "layout frame", 15, bold=True)
    sketch.arrow((0, 0), (3.0, 0), ACCENT, 2.6)
    sketch.arrow((0, 0), (0, 2.55), ACCENT, 2.6)
    sketch.dot((0, 0), 5, YELLOW)
    sketch.text((3.15, 0), "x, mm", anchor="start")
    sketch.text((0.2, 2.48), "y, mm", anchor="start")
    sketch.text((0, -2.6), "origin at marker 0, seen from the front", 12, FAINT)
    sketch.arrow((4.45, 0), (6.55, 0), INK)
    sketch.text((5.5, 0.32), "H_image_from_layout", 11.5)

    left, top, width, height = 7.1, 2.3, 4.0, 4.5
    sketch.polygon(
        [(left, top), (left + width, top), (left + width, top - height), (left, top - height)], "#e9ecef"
    )
    turned = _turned(layout, 20.0, 0.66, (left + 0.56 * width, top - 0.56 * height))
    sketch.cells(turned)
    sketch.text((left + width / 2, 2.95), "image frame", 15, bold=True)
    sketch.arrow((left, top), (left + 2.2, top), ACCENT, 2.6)
    sketch.arrow((left, top), (left, top - 1.9), ACCENT, 2.6)
    sketch.dot((left, top), 5, YELLOW)
    sketch.text((left + 2.3, top + 0.22), "x, px", anchor="start")
    sketch.text((left + 0.16, top - 1.85), "y, px", anchor="start")
    sketch.text((left + width / 2, -2.6), "origin at the centre of the top-left pixel", 12, FAINT)
    return sketch


def _turned(layout: Layout, angle_deg: float, scale: float, shift: tuple[float, float]) -> Layout:
    from dataclasses import replace

    c, s = scale * np.cos(np.radians(angle_deg)), scale * np.sin(np.radians(angle_deg))
    turn = np.array([[c, s], [-s, c]])
    return replace(
        layout,
        marker_xy_mm=layout.marker_xy_mm @ turn + shift,
        outline_mm=layout.outline_mm @ turn + shift,
    )


def pixel_centre() -> Sketch:
    """Six pixels of the image's top-left corner."""
    sketch = Sketch((540, 270), (-1.5, -2.15, 4.5, 0.85))
    shades = ["#f1f3f5", "#e3e7eb"]
    for row in range(2):
        for column in range(3):
            corners = [(column + dx - 0.5, -row + dy - 0.5) for dx, dy in ((0, 0), (1, 0), (1, 1), (0, 1))]
            sketch.polygon(corners, shades[(row + column) % 2], FAINT)
            sketch.dot((column, -row), 3, INK)
            sketch.text((column + 0.06, -row - 0.16), f"({column}, {row})", 12, anchor="start")
    sketch.dot((0, 0), 5, ACCENT, ACCENT)
    sketch.dot((-0.5, 0.5), 5, WHITE, ACCENT)
    sketch.text((-0.56, 0.66), "(-0.5, -0.5): the image's corner", 12, ACCENT, anchor="start")
    sketch.arrow((-0.9, -0.0), (-0.12, 0), ACCENT)
    sketch.text((-0.95, 0.0), "x = 0", 12, ACCENT, anchor="end")
    sketch.dot((1.62, -0.74), 4.5, YELLOW, INK)
    sketch.arrow((2.75, -0.74), (1.72, -0.74), INK)
    sketch.text((2.82, -0.74), "xy_px = (1.62, 0.74)", 12, anchor="start")
    sketch.text((1.0, -1.86), "a W x H image spans x from -0.5 to W - 0.5, y from -0.5 to H - 0.5", 12, FAINT)
    return sketch


def numbering() -> Sketch:
    """Ids of the layers 0 to 2 and their order."""
    sketch = Sketch((620, 500), (-3.45, -2.78, 3.75, 3.03))
    layout = small(2, 0.5)
    sketch.cells(layout)
    for layer in (1, 2):
        ring_xy = layout.marker_xy_mm[layout.marker_layer == layer]
        for start, end in zip(ring_xy, np.roll(ring_xy, -1, axis=0), strict=True):
            sketch.line(start, end, YELLOW, 1.6)
        sketch.arrow(
            ring_xy[0] + 0.3 * (ring_xy[1] - ring_xy[0]),
            ring_xy[0] + 0.68 * (ring_xy[1] - ring_xy[0]),
            YELLOW,
            3.0,
        )
    sketch.line((0, 0), 1.42 * layout.marker_xy_mm[7], ACCENT, 1.6, "5 4")
    for marker, xy in enumerate(layout.marker_xy_mm):
        sketch.dot(xy, 11 if marker < 10 else 12, WHITE, INK)
        sketch.text(xy, str(marker), 12, bold=True)
    sketch.text(
        1.5 * layout.marker_xy_mm[7] + (0.1, 0.02),
        "index 0 of every layer: 120°",
        13,
        ACCENT,
        anchor="middle",
    )
    sketch.turn((0, 0), 2.95, 62, 22)
    sketch.text((2.62, 2.35), "clockwise", 13, ACCENT, anchor="start")
    sketch.text((0.15, -2.55), "id = 3k(k - 1) + 1 + i for marker i of layer k", 13, FAINT)
    return sketch


def colors() -> Sketch:
    """Red, green, blue around a marker, from the front and from the back; the white cell."""
    sketch = Sketch((760, 330), (-1.55, -1.62, 6.65, 1.94))
    for shift, mirrored, title, note in (
        (0.0, False, "from the front", "red, green, blue: clockwise"),
        (5.1, True, "from the back (mirrored)", "red, green, blue: counter-clockwise"),
    ):
        layout = small(1, 0.2)
        sketch.cells(layout, (shift, 0), mirrored)
        side = -1 if mirrored else 1
        sketch.text((shift, 1.66), title, 15, bold=True)
        sketch.turn((shift, 0), 0.33, 90 + side * 118, 90 - side * 200, YELLOW)
        sketch.dot((shift, 0), 6, YELLOW)
        sketch.text((shift, -1.42), note, 12.5, FAINT)
        _letters(sketch, layout, shift, side)
    sketch.text((2.55, 0.62), "the white cell stands", 12.5)
    sketch.text((2.55, 0.4), "on marker 0; its upper", 12.5)
    sketch.text((2.55, 0.18), "corners are 1 and 2", 12.5)
    return sketch


def _letters(sketch: Sketch, layout: Layout, shift: float, side: int) -> None:
    names = {0: "R", 1: "G", 2: "B"}
    for corners, color in zip(layout.cell_corners, layout.cell_color, strict=True):
        middle = layout.marker_xy_mm[corners].mean(axis=0) * (side, 1) + (shift, 0)
        if color in names:
            sketch.text(
                middle * (1, 1) + 0.16 * _unit(middle - (shift, 0)), names[color], 15, WHITE, bold=True
            )
    for marker in (0, 1, 2):
        at = layout.marker_xy_mm[marker] * (side, 1) * 1.0 + (shift, 0)
        place = at + ((0, -0.2) if marker == 0 else (0, 0.0))
        if marker:
            sketch.dot(at, 9, WHITE, INK)
        sketch.text(place, str(marker), 12, INK if marker else WHITE, bold=True)


def _unit(vector: np.ndarray) -> np.ndarray:
    return np.asarray(vector / np.hypot(*vector))


def edges() -> Sketch:
    """Gridlines with and without contrast, and the virtual markers of one edge."""
    sketch = Sketch((760, 400), (-2.75, -2.68, 8.2, 3.08))
    layout = small(2, 0.5)
    sketch.cells(layout)
    colored = layout.cell_color != BLACK
    sides = np.stack([layout.cell_corners, np.roll(layout.cell_corners, -1, axis=1)], axis=-1)
    with_contrast = {tuple(sorted(pair)) for pair in sides[colored].reshape(-1, 2).tolist()}
    for start, end in layout.edges.tolist():
        ends = layout.marker_xy_mm[[start, end]]
        if (start, end) in with_contrast:
            sketch.line(*ends, "#dfe3e8", 1.0)
        else:
            sketch.line(*ends, YELLOW, 2.4, "5 4")
    for xy in layout.marker_xy_mm:
        sketch.dot(xy, 3.4, WHITE, INK)
    sketch.text((0, 2.75), "edges without contrast", 15, bold=True)
    sketch.text((0, -2.45), "dashed: black cells on a black border", 12, FAINT)

    a, b = np.array([3.6, -0.7]), np.array([7.7, 0.9])
    sketch.text((5.65, 2.75), "virtual markers, 5 on an edge", 15, bold=True)
    sketch.line(a, b, INK, 2)
    for j in range(5):
        at = a + (j + 1) / 6 * (b - a)
        sketch.dot(at, 5, YELLOW)
        sketch.text(at + (-0.13, 0.32), f"{j + 1}/6", 12)
        sketch.text(at + (0.16, -0.32), f"j = {j}", 12, FAINT)
    for at, marker in ((a, 3), (b, 11)):
        sketch.dot(at, 12, WHITE, INK)
        sketch.text(at, str(marker), 12, bold=True)
    sketch.text(a + (0, -0.55), "smaller id", 12, FAINT)
    sketch.text(b + (0, 0.55), "larger id", 12, FAINT)
    return sketch
