"""Pictures and tables of benchmark results, from docs/measured: the same on every machine."""

from __future__ import annotations

from pathlib import Path

from benchmarks import accuracy, extraction
from benchmarks.ablation import report as ablation
from benchmarks.acceptance import report as acceptance
from benchmarks.camera import __main__ as camera
from benchmarks.comparison import __main__ as comparison
from benchmarks.datasets import __main__ as datasets
from benchmarks.frame.published import Page, read_measured, updated_pages
from benchmarks.photoreal import __main__ as photoreal

EXPERIMENTS = (camera, comparison, datasets, extraction, photoreal)


def published() -> list[Page]:
    """What the documentation shows of every experiment."""
    precise = [accuracy.AccuracyResult(**row) for row in read_measured("accuracy")["results"]]
    others = [
        Page(accuracy.documentation_blocks(precise)),
        Page(ablation.documentation_blocks(read_measured("ablation"))),
        Page(acceptance.documentation_blocks(read_measured("acceptance")), acceptance.figures()),
    ]
    return others + [experiment.main.published() for experiment in EXPERIMENTS]


def figures() -> dict[str, bytes]:
    """Name in docs/images -> content."""
    return {name: data for page in published() for name, data in page.pictures.items()}


def pages() -> dict[Path, str]:
    """README and the pages of docs/ with a measured table."""
    return updated_pages({name: text for page in published() for name, text in page.blocks.items()})
