"""Pictures and tables of benchmark results, from docs/measured: the same on every machine."""

from __future__ import annotations

from pathlib import Path

from benchmarks import accuracy, extraction
from benchmarks.ablation import __main__ as ablation
from benchmarks.acceptance import __main__ as acceptance
from benchmarks.camera import __main__ as camera
from benchmarks.comparison import __main__ as comparison
from benchmarks.datasets import __main__ as datasets
from benchmarks.frame.published import Page, updated_pages
from benchmarks.photoreal import __main__ as photoreal
from benchmarks.studio import __main__ as studio

EXPERIMENTS = (ablation, acceptance, accuracy, camera, comparison, datasets, extraction, photoreal, studio)


def published() -> list[Page]:
    """What the documentation shows of every experiment."""
    return [experiment.main.published() for experiment in EXPERIMENTS]


def figures() -> dict[str, bytes]:
    """Name in docs/images -> content."""
    return {name: data for page in published() for name, data in page.pictures.items()}


def pages() -> dict[Path, str]:
    """README and the pages of docs/ with a measured table."""
    return updated_pages({name: text for page in published() for name, text in page.blocks.items()})
