"""Pictures and tables of benchmark results, from docs/measured: the same on every machine."""

from __future__ import annotations

from pathlib import Path

from benchmarks import accuracy, extraction
from benchmarks.ablation import report as ablation
from benchmarks.acceptance import report as acceptance
from benchmarks.camera import page as camera
from benchmarks.datasets import run as datasets
from benchmarks.photoreal import page as photoreal
from benchmarks.suites.comparison.measure import MethodResult
from benchmarks.suites.comparison.pooled import PooledResult
from benchmarks.suites.comparison.report import comparison_markdown, comparison_picture, pooled_markdown
from benchmarks.support.machine import conditions_text
from benchmarks.support.published import read_measured, updated_pages
from extractor.presets import PRESETS

# Figures of runs that are too long to be published with every change: what, figure, benchmark.
STATED = (
    (
        "random damage, 2,100 pictures",
        "16 of 779,800 markers off by more than 0.3 edges, none with another marker's id",
        "damage",
    ),
    (
        "two views, press of 1 mm",
        "0.6 um across, 1.5 um in depth ([table](docs/how-to/reconstruction.md#how-precise))",
        "reconstruction",
    ),
    (
        "kerf from a photo of the coupon",
        "5.1 um RMS ([table](docs/how-to/laser.md#measure-first))",
        "kerf",
    ),
    ("molds of 1,452 cells as STEP", "11 s ([table](docs/how-to/molds.md#figures))", "molds"),
    (
        "start of a process to its first markers",
        "twice the time to import numpy and OpenCV, 65 MB",
        "startup",
    ),
)


def _compared() -> list[MethodResult]:
    return [MethodResult(**row) for row in read_measured("comparison")["results"]]


def figures() -> dict[str, bytes]:
    """Name in docs/images -> PNG."""
    return {"speed-error.png": comparison_picture(_compared())} | acceptance.figures()


def pages() -> dict[Path, str]:
    """README and the pages of docs/ with a measured table."""
    precise = [accuracy.AccuracyResult(**row) for row in read_measured("accuracy")["results"]]
    conditions = conditions_text(read_measured("comparison")["conditions"])
    blocks = {
        "comparison": comparison_markdown(_compared()),
        "conditions": conditions,
        "figures": key_figures(_compared()),
        "speed": preset_times(_compared()),
    }
    pooled = [PooledResult(**row) for row in read_measured("comparison").get("pooled", ())]
    if pooled:
        blocks["comparison-pooled"] = pooled_markdown(pooled)
    return updated_pages(
        blocks
        | accuracy.documentation_blocks(precise)
        | extraction.markdown(read_measured("extraction"))
        | datasets.markdown(read_measured("datasets"))
        | camera.documentation_blocks(read_measured("camera"))
        | photoreal.documentation_blocks(read_measured("photoreal"))
        | ablation.documentation_blocks(read_measured(ablation.NAME))
        | acceptance.documentation_blocks(read_measured(acceptance.NAME))
    )


def preset_times(results: list[MethodResult]) -> str:
    """The table of docs/how-to/speed.md: the time and the error of every preset in the standard scene."""
    rows = ["| preset | time of 397 markers, ms | error of the exact bound |", "|---|---|---|"]
    for preset in PRESETS:
        flat = _flat(results, preset)
        rows.append(f"| `{preset}` | {flat.ms:.1f} | {flat.inner_px / flat.bound_px:.2f} |")
    return "\n".join([*rows, "", "Printed by `python -m benchmarks.comparison`."])


def _flat(results: list[MethodResult], preset: str) -> MethodResult:
    return next(r for r in results if (r.method, r.scene) == (f"cmpdesign, {preset}", "flat"))


def key_figures(results: list[MethodResult]) -> str:
    """The table of README: what is measured, and the command that prints it."""
    rows = ["| measured | figure | printed by |", "|---|---|---|"]
    for preset in PRESETS:
        flat = _flat(results, preset)
        of_bound = flat.inner_px / flat.bound_px
        rows.append(
            f"| 397 markers at 20 px, preset `{preset}` | {flat.inner_px:.4f} px RMS per axis, {of_bound:.2f} of the "
            f"[exact bound](docs/explanation/accuracy.md); {flat.ms:.1f} ms | `python -m benchmarks.comparison` |"
        )
    rows += [f"| {what} | {figure} | `python -m benchmarks.{name}` |" for what, figure, name in STATED]
    return "\n".join(rows)
