"""What a process sheet says: pages of steps, and materials."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple


class Table(NamedTuple):
    """A table: column heads, and rows of texts."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Step:
    """One page.

    Attributes:
        title: what is done.
        checks: single actions in order; each has a box to tick.
        tables: masses, times and temperatures.
        warnings: what may fail here, with the remedy.
        pictures: names of pictures that the page shows.
    """

    title: str
    checks: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    warnings: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()


@dataclass(frozen=True)
class ProcessSheet:
    """All pages.

    Attributes:
        title: title of the whole.
        summary: facts for the first page.
        steps: the pages in order of work.
        footnote: what marks an assumed value, and where the value is changed.
    """

    title: str
    summary: tuple[str, ...]
    steps: tuple[Step, ...]
    footnote: str


class NeededMaterial(NamedTuple):
    """A line of the bill of materials; the part number is left to the shop."""

    item: str
    use: str
    amount: float
    unit: str


def materials_csv(materials: Sequence[NeededMaterial]) -> str:
    """The bill of materials as CSV: item, use, amount, unit, part_number (empty)."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*NeededMaterial._fields, "part_number"])
    writer.writerows([one.item, one.use, f"{one.amount:.6g}", one.unit, ""] for one in materials)
    return text.getvalue()


def materials_table(materials: Sequence[NeededMaterial]) -> Table:
    """The bill of materials as a table."""
    rows = tuple((one.item, one.use, f"{one.amount:.4g} {one.unit}", "") for one in materials)
    return Table(("item", "use", "amount", "part number"), rows)
