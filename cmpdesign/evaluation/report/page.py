"""A report as one self-contained HTML page: text, tables, plots as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

# Tables of more columns are set smaller, so that they fit the width of the page.
MANY_COLUMNS = 8
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2126; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .8rem; border-bottom: 1px solid #d7dce0; text-align: right; white-space: nowrap; }
th, th:first-child, td:first-child { white-space: normal; overflow-wrap: anywhere; }
.wide { overflow-x: auto; } .many th, .many td { padding: .25rem .4rem; font-size: .8rem; }
@media print { .wide { overflow-x: visible; } }
th:first-child, td:first-child { text-align: left; } th { border-bottom: 2px solid #8a949c; font-weight: 600; }
figure { margin: 1rem 0; } svg { max-width: 100%; height: auto; }
caption, figcaption { color: #5a646c; text-align: left; font-size: .9rem; }
"""


@dataclass(frozen=True)
class ReportTable:
    """Rows of cells under headings; cells are escaped texts."""

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Plot:
    """A drawing as SVG, with its caption."""

    caption: str
    svg: str


@dataclass(frozen=True)
class Section:
    """A heading and its content: paragraphs, a list, tables, plots."""

    title: str
    paragraphs: Sequence[str] = ()
    points: Sequence[str] = ()
    tables: Sequence[ReportTable] = ()
    plots: Sequence[Plot] = field(default_factory=tuple)


def report_html(title: str, sections: Sequence[Section]) -> str:
    """The page's HTML; the same sections give the same bytes."""
    body = "\n".join(_section_html(section) for section in sections)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


def _section_html(section: Section) -> str:
    parts = [f"<h2>{escape(section.title)}</h2>"]
    parts += [f"<p>{escape(text)}</p>" for text in section.paragraphs]
    if section.points:
        parts.append("<ul>" + "".join(f"<li>{escape(text)}</li>" for text in section.points) + "</ul>")
    parts += [_table_html(table) for table in section.tables]
    parts += [
        f"<figure>{plot.svg}<figcaption>{escape(plot.caption)}</figcaption></figure>"
        for plot in section.plots
    ]
    return "\n".join(parts)


def _table_html(table: ReportTable) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in table.headings)
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows
    )
    many = ' class="many"' if len(table.headings) > MANY_COLUMNS else ""
    caption = f"<caption>{escape(table.caption)}</caption>"
    return f'<div class="wide"><table{many}>{caption}\n<tr>{head}</tr>\n{rows}\n</table></div>'
