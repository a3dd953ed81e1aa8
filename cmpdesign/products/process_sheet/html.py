"""A process sheet as one HTML page without scripts; a printer starts a page with every step."""

from __future__ import annotations

from html import escape

from cmpdesign.products.process_sheet.steps import ProcessSheet, Step, Table

_STYLE = """
@page { size: A4; margin: 14mm }
body { font: 11pt/1.45 system-ui, sans-serif; color: #1c1a18; max-width: 182mm; margin: 8mm auto }
h1 { font-size: 18pt; margin: 0 0 2mm } h2 { font-size: 14pt; margin: 8mm 0 2mm; border-bottom: .3mm solid }
section { break-before: page } table { border-collapse: collapse; margin: 3mm 0 }
td, th { text-align: left; padding: .6mm 2.5mm; border-bottom: .15mm solid #bbb; vertical-align: top }
ul { list-style: none; padding: 0 } li { margin: 1.6mm 0; padding-left: 8mm; text-indent: -8mm }
li::before { content: "\\2610"; display: inline-block; width: 8mm; text-indent: 0; font-size: 13pt; line-height: 1 }
.warn { border: .5mm solid #b3261e; padding: 2mm 3mm; margin: 3mm 0 } img { max-width: 60mm; margin: 0 3mm 2mm 0 }
@media print { body { margin: 0 } table { font-size: 9.5pt } }
img.whole { max-width: 100%; max-height: 60mm } small { color: #5c5650 }
"""


def sheet_to_html(sheet: ProcessSheet, folder: str) -> str:
    """Format the sheet, whose pictures are PNG files in a folder beside it."""
    head = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(sheet.title)}</title>'
    )
    lines = [f"{head}<style>{_STYLE}</style></head><body>", f"<h1>{escape(sheet.title)}</h1>"]
    lines += [f"<p>{escape(text)}</p>" for text in sheet.summary]
    for number, step in enumerate(sheet.steps, start=1):
        lines += ["<section>" if number > 1 else "<div>"]
        lines += _step_lines(number, step, folder)
        lines += [f"<p><small>{escape(sheet.footnote)}</small></p>", "</section>" if number > 1 else "</div>"]
    return "\n".join([*lines, "</body></html>", ""])


def _step_lines(number: int, step: Step, folder: str) -> list[str]:
    size = ' class="whole"' if len(step.pictures) == 1 else ""
    return [
        f"<h2>{number}. {escape(step.title)}</h2>",
        *(f'<p class="warn">{escape(text)}</p>' for text in step.warnings),
        *(_table_html(table) for table in step.tables),
        "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in step.checks) + "</ul>",
        *(f'<img{size} src="{folder}/{escape(name)}.png" alt="{escape(name)}">' for name in step.pictures),
    ]


def _table_html(table: Table) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in table.head)
    rows = ("".join(f"<td>{escape(text)}</td>" for text in row) for row in table.rows)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"
