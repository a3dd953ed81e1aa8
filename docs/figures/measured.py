"""Pictures and tables of benchmark results, from docs/measured: the same on every machine."""

from __future__ import annotations

from pathlib import Path

from benchmarks import accuracy, extraction
from benchmarks.camera import page as camera
from benchmarks.suites.comparison.measure import MethodResult
from benchmarks.suites.comparison.pooled import PooledResult
from benchmarks.suites.comparison.report import comparison_markdown, comparison_picture, pooled_markdown
from benchmarks.support.machine import conditions_text
from benchmarks.support.published import read_measured, updated_pages


def _compared() -> list[MethodResult]:
    return [MethodResult(**row) for row in read_measured("comparison")["results"]]


def figures() -> dict[str, bytes]:
    """Name in docs/images -> PNG."""
    return {"speed-error.png": comparison_picture(_compared())}


def pages() -> dict[Path, str]:
    """README and the pages of docs/ with a measured table."""
    precise = [accuracy.AccuracyResult(**row) for row in read_measured("accuracy")["results"]]
    conditions = conditions_text(read_measured("comparison")["conditions"])
    blocks = {"comparison": comparison_markdown(_compared()), "conditions": conditions}
    pooled = [PooledResult(**row) for row in read_measured("comparison").get("pooled", ())]
    if pooled:
        blocks["comparison-pooled"] = pooled_markdown(pooled)
    return updated_pages(
        blocks
        | accuracy.documentation_blocks(precise)
        | extraction.markdown(read_measured("extraction"))
        | camera.documentation_blocks(read_measured("camera"))
    )
