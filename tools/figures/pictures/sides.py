"""The drawing of the two sides: camera, window, gel, pattern and skin for both values of ``mirrored``."""

from __future__ import annotations

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.layout.side import seen_side, turned_over

from .sketch import ACCENT, FAINT, INK, Sketch

# Layers over the camera: name, note, thickness, color.
LAYERS = (
    ("window", "glass or acrylic", 0.35, "#cfe3ee"),
    ("gel", "clear silicone: the mold's base layer", 0.9, "#e6f1f6"),
    ("pattern", "the marker layer", 0.3, "#141414"),
    ("skin", "the mold's cover, may be opaque", 0.3, "#d9cdb8"),
)
CELLS = ("#c8322d", "#28963c", "#2d3cbe")
WIDTH = 3.6


def figures() -> dict[str, bytes]:
    """File name -> SVG."""
    return {"sides.svg": sides().text_of().encode()}


def sides() -> Sketch:
    """Two sections, and beside each what its camera sees."""
    sketch = Sketch((860, 700), (-0.85, -3.5, 11.75, 6.35))
    for y, mirrored in ((3.1, False), (-1.7, True)):
        _section(sketch, y, mirrored)
        _view(sketch, y + 0.75, mirrored)
    return sketch


def _section(sketch: Sketch, y: float, mirrored: bool) -> None:
    """A pad over its camera, with the pattern's front and back named."""
    value = "true" if mirrored else "false"
    sketch.text((1.8, y + 2.85), f"mirrored = {value}", 16, bold=True)
    sketch.text((1.8, y + 2.5), f"the camera sees the {seen_side(mirrored)}", 12.5, FAINT)
    level = y
    for name, note, thickness, color in LAYERS:
        corners = [(0, level), (WIDTH, level), (WIDTH, level + thickness), (0, level + thickness)]
        sketch.polygon(corners, color, FAINT)
        if name == "pattern":
            _cells(sketch, level, thickness, CELLS[::-1] if mirrored else CELLS)
            above, below = ("front", "back") if mirrored else ("back", "front")
            sketch.text((-0.08, level + thickness + 0.13), above, 11, ACCENT, anchor="end")
            sketch.text((-0.08, level - 0.13), below, 11, ACCENT, anchor="end")
        sketch.text((WIDTH + 0.12, level + thickness / 2), name, 12.5, INK, anchor="start", bold=True)
        sketch.text((WIDTH + 1.0, level + thickness / 2), note, 11.5, FAINT, anchor="start")
        level += thickness
    sketch.text((WIDTH / 2, level + 0.16), "touched from here", 11.5, FAINT)
    _camera(sketch, y)


def _cells(sketch: Sketch, level: float, thickness: float, colors: tuple[str, ...]) -> None:
    """Cells as a mold makes them: nominal at the camera's side, wider away from it."""
    for number in range(6):
        left = 0.3 + 0.53 * number
        corners = [
            (left, level),
            (left + 0.34, level),
            (left + 0.39, level + thickness),
            (left - 0.05, level + thickness),
        ]
        sketch.polygon(corners, colors[number % 3])


def _camera(sketch: Sketch, y: float) -> None:
    middle = WIDTH / 2
    for low, high, bottom, top in ((0.3, 0.3, 1.15, 0.8), (0.16, 0.22, 0.8, 0.66)):  # body and lens
        corners = [(-low, -bottom), (low, -bottom), (high, -top), (-high, -top)]
        sketch.polygon([(middle + dx, y + dy) for dx, dy in corners], INK)
    sketch.arrow((middle, y - 0.6), (middle, y - 0.08), ACCENT, 2.4)
    sketch.text((middle + 0.42, y - 0.97), "camera", 12.5, INK, anchor="start", bold=True)


def _view(sketch: Sketch, y: float, mirrored: bool) -> None:
    """The pattern as this camera shows it."""
    layout = _small()
    shown = turned_over(layout) if mirrored else layout
    sketch.text((9.9, y + 2.1), "the picture", 14, bold=True)
    sketch.cells(shown, (9.9, y + 0.35))
    turn = "counter-clockwise" if mirrored else "clockwise"
    side = -1 if mirrored else 1
    sketch.turn((9.9, y + 0.35), 0.33, 90 + side * 118, 90 - side * 200, "#ffe94a")
    sketch.text((9.9, y - 1.35), f"red, green, blue: {turn}", 12, FAINT)


def _small() -> Layout:
    return build_layout(Design(pattern="honeycomb", layers=1, pitch_mm=1.05, border_mm=0.25))
