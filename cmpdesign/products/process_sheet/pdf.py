"""A process sheet as PDF: A4, one page a step, without a date: the same bytes for the same sheet."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import escape

from cmpdesign.libraries import extra
from cmpdesign.products.process_sheet.steps import ProcessSheet, Step, Table

MARGIN_MM = 16.0
# A step's pictures share this height.
PICTURES_MM = 78.0
_INK, _RULE, _WARNING = "#1c1a18", "#bbbbbb", "#b3261e"


def sheet_to_pdf(sheet: ProcessSheet, pictures: Mapping[str, bytes]) -> bytes:
    """Format the sheet.

    Args:
        sheet: the sheet.
        pictures: name -> PNG, of the steps' pictures.

    Raises:
        MissingLibraryError: ReportLab is not installed.
    """
    with extra("print"):
        from reportlab.lib.pagesizes import A4
        from reportlab.lib.units import mm
        from reportlab.platypus import PageBreak, SimpleDocTemplate

    style = _Style()
    story: list[Any] = [style.title(sheet.title), *(style.text(line) for line in sheet.summary)]
    for number, step in enumerate(sheet.steps, start=1):
        story += [PageBreak()] if number > 1 else []
        story += _step_flow(number, step, pictures, style)
        story.append(style.small(sheet.footnote))
    result = io.BytesIO()
    margins = dict.fromkeys(("leftMargin", "rightMargin", "topMargin", "bottomMargin"), MARGIN_MM * mm)
    SimpleDocTemplate(result, pagesize=A4, title=sheet.title, invariant=1, **margins).build(story)
    return result.getvalue()


def _step_flow(number: int, step: Step, pictures: Mapping[str, bytes], style: _Style) -> list[Any]:
    with extra("print"):
        from reportlab.lib.units import mm
        from reportlab.platypus import Image, Spacer

    flow = [style.heading(f"{number}. {step.title}")]
    flow += [style.warning(text) for text in step.warnings]
    flow += [style.table(table) for table in step.tables]
    flow.append(style.check_list(step.checks))
    drawn = []
    for name in step.pictures:
        image = Image(io.BytesIO(pictures[name]))
        scale = min(PICTURES_MM * mm / image.imageHeight, 84 * mm / image.imageWidth)
        image.drawHeight, image.drawWidth = scale * image.imageHeight, scale * image.imageWidth
        drawn.append(image)
    if drawn:
        flow += [Spacer(1, 3 * mm), style.in_rows(drawn, 2)]
    return flow


class _Style:
    """ReportLab's flowables in the look of the sheet."""

    def __init__(self) -> None:
        with extra("print"):
            from reportlab import platypus
            from reportlab.lib.colors import HexColor
            from reportlab.lib.styles import ParagraphStyle
            from reportlab.lib.units import mm

        self._color, self._flow, self._mm = HexColor, platypus, mm
        base = {"textColor": HexColor(_INK), "fontName": "Helvetica"}
        self._text = ParagraphStyle("text", fontSize=10, leading=13.5, spaceAfter=4, **base)
        self._cell = ParagraphStyle("cell", fontSize=9, leading=11, **base)
        self._small = ParagraphStyle("small", fontSize=8, leading=10, spaceBefore=8, **base)
        bold = base | {"fontName": "Helvetica-Bold"}
        self._title = ParagraphStyle("title", fontSize=18, leading=23, spaceAfter=6, **bold)
        self._heading = ParagraphStyle("heading", fontSize=14, leading=20, spaceAfter=4, **bold)

    def title(self, text: str) -> Any:
        return self._paragraph(text, self._title)

    def heading(self, text: str) -> Any:
        return self._paragraph(text, self._heading)

    def text(self, text: str) -> Any:
        return self._paragraph(text, self._text)

    def small(self, text: str) -> Any:
        return self._paragraph(text, self._small)

    def warning(self, text: str) -> Any:
        return self._grid([[self.text(text)]], None, [("BOX", (0, 0), (-1, -1), 1.2, self._color(_WARNING))])

    def table(self, table: Table) -> Any:
        head = [self._paragraph(f"<b>{escape(text)}</b>", self._cell, marked_up=True) for text in table.head]
        rows = [head, *([self._paragraph(text, self._cell) for text in row] for row in table.rows)]
        return self._grid(rows, None, [("LINEBELOW", (0, 0), (-1, -1), 0.4, self._color(_RULE))])

    def check_list(self, texts: tuple[str, ...]) -> Any:
        """Texts with an empty box before each."""
        mm = self._mm
        line = [("BOX", (0, 0), (0, 0), 0.8, self._color(_INK))]
        rows = [[self._grid([[""]], [4 * mm], line, [4 * mm]), self.text(text)] for text in texts]
        return self._grid(rows, [9 * mm, 164 * mm], [])

    def in_rows(self, cells: list[Any], columns: int) -> Any:
        """Flowables side by side."""
        rows = [cells[i : i + columns] for i in range(0, len(cells), columns)]
        rows[-1] += [""] * (len(rows[0]) - len(rows[-1]))
        return self._grid(rows, None, [])

    def _paragraph(self, text: str, style: Any, marked_up: bool = False) -> Any:
        return self._flow.Paragraph(text if marked_up else escape(text), style)

    def _grid(self, rows: list[Any], widths: Any, lines: list[Any], heights: Any = None) -> Any:
        style = [("VALIGN", (0, 0), (-1, -1), "TOP"), *lines]
        return self._flow.Table(rows, widths, heights, style=style, hAlign="LEFT", spaceAfter=6)
