"""Sections of a mold at four steps of the casting, as in the job sheet."""

from __future__ import annotations

from ..sketch import ACCENT, FAINT, INK, Sketch

CLEAR, BLACK, COVER, PART, RED = "#d8ebf5", "#141414", "#d9cdb8", "#b9bfc8", "#c8322d"
COLORS = (RED, "#28963c", "#2d3cbe")
WIDTH, TRAY, BASE, LAYER = 4.2, 0.3, 0.8, 0.45  # of the pad and the parts, in the drawing's units
PITCH, CELL = 0.65, 0.42
STEPS = ("1  pour the base", "2  press in a plate", "3  fill through a stencil", "4  pour the cover")
PLACES = ((0.0, 0.0), (6.2, 0.0), (0.0, -3.7), (6.2, -3.7))


def casting() -> Sketch:
    """Four sections, from the tray to the pad."""
    sketch = Sketch((860, 560), (-0.9, -4.7, 11.3, 3.25))
    for number, (x, y) in enumerate(PLACES):
        sketch.text((x + WIDTH / 2, y + 2.55), STEPS[number], 16, bold=True)
        _tray(sketch, x, y)
        (_pour, _press, _fill, _cover)[number](sketch, x, y)
    return sketch


def _box(sketch: Sketch, left: float, bottom: float, width: float, height: float, fill: str) -> None:
    right, top = left + width, bottom + height
    sketch.polygon([(left, bottom), (right, bottom), (right, top), (left, top)], fill, FAINT)


def _cell(sketch: Sketch, x: float, bottom: float, number: int, fill: str) -> None:
    """A cavity or its filling, which widens upward."""
    left = x + 0.25 + PITCH * number
    corners = [
        (left, bottom),
        (left + CELL, bottom),
        (left + CELL + 0.05, bottom + LAYER),
        (left - 0.05, bottom + LAYER),
    ]
    sketch.polygon(corners, fill)


def _tray(sketch: Sketch, x: float, y: float) -> None:
    """The base part with the clear layer in it."""
    _box(sketch, x - 0.5, y - TRAY, WIDTH + 1.0, TRAY, PART)
    for left in (x - 0.5, x + WIDTH):
        _box(sketch, left, y, 0.5, BASE, PART)
    _box(sketch, x, y, WIDTH, BASE, CLEAR)


def _frame(sketch: Sketch, x: float, y: float) -> float:
    """The frame with the black layer; the height of its lower face."""
    for left in (x - 0.5, x + WIDTH):
        _box(sketch, left, y + BASE, 0.5, LAYER, PART)
    _box(sketch, x, y + BASE, WIDTH, LAYER, BLACK)
    return y + BASE


def _pour(sketch: Sketch, x: float, y: float) -> None:
    sketch.text((x + WIDTH / 2, y + BASE / 2), "clear silicone", 12.5, INK)
    sketch.text((x + WIDTH / 2, y - TRAY / 2), "base", 11.5, INK)
    sketch.arrow((x + WIDTH / 2, y + 1.9), (x + WIDTH / 2, y + BASE + 0.1), ACCENT, 2.4)


def _press(sketch: Sketch, x: float, y: float) -> None:
    level = _frame(sketch, x, y)
    _box(sketch, x - 0.5, level + LAYER, WIDTH + 1.0, 0.4, PART)
    for number in (0, 3):
        _cell(sketch, x, level, number, PART)
    sketch.text((x + WIDTH / 2, level + LAYER + 0.2), "boss-red", 11.5, INK)
    sketch.arrow((x + WIDTH / 2, level + 1.5), (x + WIDTH / 2, level + LAYER + 0.45), ACCENT, 2.4)


def _fill(sketch: Sketch, x: float, y: float) -> None:
    level = _frame(sketch, x, y)
    left = x - 0.5
    for number in (0, 3):
        _cell(sketch, x, level, number, RED)
        hole = x + 0.15 + PITCH * number
        _box(sketch, left, level + LAYER, hole - left, 0.16, PART)
        left = hole + CELL + 0.2
    _box(sketch, left, level + LAYER, x + WIDTH + 0.5 - left, 0.16, PART)
    sketch.text((x + 2.2, level + LAYER + 0.75), "stencil-red; then green, blue, white", 11.5, INK)


def _cover(sketch: Sketch, x: float, y: float) -> None:
    level = _frame(sketch, x, y)
    for number in range(6):
        _cell(sketch, x, level, number, COLORS[number % 3])
    for left in (x - 0.5, x + WIDTH):
        _box(sketch, left, level + LAYER, 0.5, LAYER, PART)
    _box(sketch, x, level + LAYER, WIDTH, LAYER, COVER)
    sketch.text((x + WIDTH / 2, level + 1.5 * LAYER), "cover", 11.5, INK)
    sketch.text((x + WIDTH / 2, y - 0.72), "the camera looks from below, through the clear base", 11.5, FAINT)
