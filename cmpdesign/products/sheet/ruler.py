"""The ruler line of a print sheet: millimetres to compare with a steel rule."""

from __future__ import annotations

from cmpdesign.errors import DesignError
from cmpdesign.products.sheet.page import FilledPolygons, TextLine, rectangle_points

RULER_MM = 9.0  # height with its numbers
LINE_MM, TEXT_MM = 0.15, 2.2
STEP_MM = 10
# Length of the mark at a millimetre that is a multiple of the number.
MARKS_MM = {10: 4.0, 5: 3.0, 1: 2.0}
INK = "#000000"


def ruler_items(left_mm: float, bottom_mm: float, right_mm: float) -> list[FilledPolygons | TextLine]:
    """A ruler of whole centimetres between two sides of a page.

    The distance of two marks is that of their left sides.

    Args:
        left_mm, right_mm: where the ruler begins, and where it ends at the latest.
        bottom_mm: the lower side of its numbers, y down.

    Raises:
        DesignError: the page is too narrow for a centimetre.
    """
    length = int((right_mm - left_mm) // STEP_MM) * STEP_MM
    if length < STEP_MM:
        raise DesignError(
            f"sheet.ruler: {right_mm - left_mm:.4g} mm are too few for a ruler of {STEP_MM} mm; choose a wider "
            "sheet.page"
        )
    top = bottom_mm - RULER_MM + 2.0
    lines = [rectangle_points(left_mm, top, length + LINE_MM, LINE_MM)]
    for place in range(length + 1):
        mark = next(size for step, size in MARKS_MM.items() if place % step == 0)
        lines.append(rectangle_points(left_mm + place, top, LINE_MM, mark))
    numbers = [
        TextLine(
            f"{place} mm" if place == length else f"{place}", left_mm + place + 0.6, bottom_mm - 1.0, TEXT_MM
        )
        for place in range(0, length + 1, STEP_MM)
    ]
    return [FilledPolygons(lines, INK, "ruler"), *numbers]
