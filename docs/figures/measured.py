"""What the benchmarks measured, drawn and tabled from docs/measured: the same on every machine."""

from __future__ import annotations

from pathlib import Path

from benchmarks.comparison.measure import Result
from benchmarks.comparison.report import markdown, picture
from benchmarks.published import measured, pages_with


def _results() -> list[Result]:
    return [Result(**row) for row in measured("comparison")["results"]]


def figures() -> dict[str, bytes]:
    """Name in docs/images -> PNG."""
    return {"speed-error.png": picture(_results())}


def pages() -> dict[Path, str]:
    """The pages that show a measured table."""
    return pages_with({"comparison": markdown(_results())})
