"""A printed page as a list of shapes in mm (x right, y down), and the page as SVG and PDF."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra

DECIMALS = 6
POINTS_PER_MM = 72 / 25.4
EM_PER_LETTER = 0.56  # width of the mean letter of Helvetica, in units of its height


@dataclass(frozen=True, eq=False)
class FilledPolygons:
    """Filled polygons of one color ("#rrggbb"), each (N, 2) in mm; ``name`` is the id of the SVG group."""

    polygons: Sequence[NDArray[np.float64]]
    color: str
    name: str = ""


@dataclass(frozen=True)
class TextLine:
    """One line of text; x and y give the left end of the base line; a ``turned`` text runs upwards."""

    text: str
    x_mm: float
    y_mm: float
    size_mm: float
    turned: bool = False


@dataclass(frozen=True, eq=False)
class Page:
    """A page and its shapes in the order of drawing.

    ``trim_mm`` and ``bleed_mm`` are the corners (4, 2) of the rectangles that are cut out and that are printed.
    """

    width_mm: float
    height_mm: float
    title: str
    items: Sequence[FilledPolygons | TextLine]
    trim_mm: NDArray[np.float64] | None = None
    bleed_mm: NDArray[np.float64] | None = None


def fitted_size_mm(texts: Sequence[str], room_mm: float, most_mm: float) -> float:
    """The height of letters, at most ``most_mm``, with which the longest text is as wide as the room."""
    return min(most_mm, room_mm / (EM_PER_LETTER * max(map(len, texts))))


def rectangle_points(left: float, top: float, width: float, height: float) -> NDArray[np.float64]:
    """(4, 2) corners of an upright rectangle, clockwise on the page from the upper left one."""
    right, bottom = left + width, top + height
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])


def page_to_svg(page: Page) -> str:
    """Format the page as SVG with width, height and viewBox in mm."""
    import svgwrite

    drawing = svgwrite.Drawing(
        size=(f"{page.width_mm:g}mm", f"{page.height_mm:g}mm"),
        viewBox=f"0 0 {page.width_mm:g} {page.height_mm:g}",
        debug=False,
    )
    drawing.set_desc(title=page.title)
    for item in page.items:
        if isinstance(item, TextLine):
            drawing.add(_svg_text(drawing, item))
            continue
        group = drawing.g(fill=item.color, **({"id": item.name} if item.name else {}))
        for polygon in item.polygons:
            points = (np.round(polygon, DECIMALS) + 0.0).tolist()
            group.add(drawing.path(d="M" + "L".join(f"{x!r} {y!r}" for x, y in points) + "Z"))
        drawing.add(group)
    return f'<?xml version="1.0" encoding="utf-8" ?>\n{drawing.tostring()}\n'


def _svg_text(drawing: Any, item: TextLine) -> Any:
    style = {"font_size": item.size_mm, "font_family": "Helvetica, Arial, sans-serif", "fill": "#000000"}
    if not item.turned:
        return drawing.text(item.text, insert=(item.x_mm, item.y_mm), **style)
    return drawing.text(item.text, transform=f"translate({item.x_mm} {item.y_mm}) rotate(-90)", **style)


def pages_to_pdf(*pages: Page) -> bytes:
    """Format pages as PDF at true size, without a date: the same bytes for the same pages."""
    with extra("print"):
        from reportlab.pdfgen.canvas import Canvas

    result = io.BytesIO()
    with _no_date_of_environment():
        canvas = Canvas(result, invariant=1)
    canvas.setTitle(pages[0].title)
    for page in pages:
        _draw_pdf_page(canvas, page)
    canvas.save()
    return result.getvalue()


def _draw_pdf_page(canvas: Any, page: Page) -> None:
    with extra("print"):
        from reportlab.lib.colors import HexColor

    canvas.setPageSize((page.width_mm * POINTS_PER_MM, page.height_mm * POINTS_PER_MM))
    for name, box in (("trim", page.trim_mm), ("bleed", page.bleed_mm)):
        if box is not None:
            points = np.stack([box[:, 0], page.height_mm - box[:, 1]], axis=1) * POINTS_PER_MM
            canvas.setCropBox((*points.min(axis=0).tolist(), *points.max(axis=0).tolist()), name)
    # From here on coordinates are in mm, y up.
    canvas.scale(POINTS_PER_MM, POINTS_PER_MM)
    for item in page.items:
        if isinstance(item, TextLine):
            _pdf_text(canvas, item, page.height_mm)
            continue
        canvas.setFillColor(HexColor(item.color))
        path = canvas.beginPath()
        for polygon in item.polygons:
            (x, y), *others = polygon.tolist()
            path.moveTo(x, page.height_mm - y)
            for x, y in others:
                path.lineTo(x, page.height_mm - y)
            path.close()
        canvas.drawPath(path, stroke=0, fill=1)
    canvas.showPage()


@contextmanager
def _no_date_of_environment() -> Iterator[None]:
    """Within this context, reportlab takes its own fixed date: it prefers SOURCE_DATE_EPOCH also where invariant."""
    date = os.environ.pop("SOURCE_DATE_EPOCH", None)
    try:
        yield
    finally:
        if date is not None:
            os.environ["SOURCE_DATE_EPOCH"] = date


def _pdf_text(canvas: Any, item: TextLine, height_mm: float) -> None:
    canvas.saveState()
    canvas.setFillGray(0)
    canvas.translate(item.x_mm, height_mm - item.y_mm)
    if item.turned:
        canvas.rotate(90)
    canvas.setFont("Helvetica", item.size_mm)
    canvas.drawString(0, 0, item.text)
    canvas.restoreState()
