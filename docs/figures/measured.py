"""What the benchmarks measured, drawn and tabled from docs/measured: the same on every machine."""

from __future__ import annotations

from pathlib import Path

from benchmarks import accuracy, extraction
from benchmarks.suites.comparison.measure import Result
from benchmarks.suites.comparison.report import markdown, picture
from benchmarks.support.machine import sentence
from benchmarks.support.published import measured, pages_with


def _compared() -> list[Result]:
    return [Result(**row) for row in measured("comparison")["results"]]


def figures() -> dict[str, bytes]:
    """Name in docs/images -> PNG."""
    return {"speed-error.png": picture(_compared())}


def pages() -> dict[Path, str]:
    """README and the pages of docs/ that show a measured table."""
    precise = [accuracy.Result(**row) for row in measured("accuracy")["results"]]
    conditions = sentence(measured("comparison")["conditions"])
    blocks = {"comparison": markdown(_compared()), "conditions": conditions}
    return pages_with(blocks | accuracy.blocks(precise) | extraction.markdown(measured("extraction")))
