"""Tables of figures: one definition for the terminal, for pages and for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

TEXT = ""  # the format of a column of words


@dataclass(frozen=True)
class Table:
    """Rows of values.

    Attributes:
        title: above the table; "" for none.
        columns: heading -> format of its values as ``format`` takes it; ``TEXT`` columns are aligned to the left.
        rows: one value a column. A tuple is written side by side, None and NaN as "-", a text as it is.
        caption: below the table.
    """

    title: str
    columns: Mapping[str, str]
    rows: Sequence[Sequence[Any]]
    caption: str = ""

    def cells(self) -> list[list[str]]:
        """The texts of all rows."""
        formats = list(self.columns.values())
        return [[_text(*pair) for pair in zip(row, formats, strict=True)] for row in self.rows]

    def records(self) -> list[dict[str, Any]]:
        """Heading -> value, a row each."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    def markdown(self) -> str:
        """The table of a page, without its title."""
        head, *rows = (f"| {' | '.join(line)} |" for line in (list(self.columns), *self.cells()))
        return "\n".join([head, "|" + "---|" * len(self.columns), *rows])

    def __str__(self) -> str:
        lines = [list(self.columns), *self.cells()]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        marks = ["<" if spec == TEXT else ">" for spec in self.columns.values()]
        drawn = [
            "  ".join(f"{cell:{mark}{width}}" for cell, mark, width in zip(line, marks, widths, strict=True))
            for line in lines
        ]
        found = [*([self.title] if self.title else []), *drawn, *([self.caption] if self.caption else [])]
        return "\n".join(line.rstrip() for line in found)


def _text(value: Any, spec: str) -> str:
    if isinstance(value, tuple):
        return " ".join(_text(each, spec) for each in value)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return value if isinstance(value, str) else format(value, spec)
