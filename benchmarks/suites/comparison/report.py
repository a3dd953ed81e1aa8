"""The comparison as tables, pages and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.frame.conditions import conditions_text
from benchmarks.frame.plots import png_of, pyplot
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.comparison.measure import MethodResult, PooledResult
from benchmarks.suites.comparison.methods import METHODS
from extractor.presets import PRESETS

COLUMNS = {
    "method": TEXT, "found": ".1%", "wrong": "d", "inner px": ".4f", "inner / bound": ".2f", "all px": ".4f",
    "all / bound": ".2f", "bias px": ".4f", "ms": ".1f", "time / SB": ".3f",
}  # fmt: skip
PAGE_COLUMNS = {
    "method": TEXT, "reads": TEXT, "found": ".0%", "wrong": "d", "RMS px": ".4f", "of the bound": ".2f",
    "worst scene": TEXT, "ms": ".1f", "of SB's time": ".2f",
}  # fmt: skip
POOLED_COLUMNS = {
    "method": TEXT, "scenes": "d", "found": ".1%", "wrong": "d", "RMS px": ".4f", "of the bound": ".2f",
    "inner px": ".4f", "of their bound": ".2f", "z": ".2f", "ms": ".1f",
}  # fmt: skip
MARKS = {
    "flat": "o", "tilt": "^", "bulge": "s", "twist": "D", "blur 1.6 px": "v", "pitch 13 px": "*", "round": "h",
    "elliptical": "p",
}  # fmt: skip
COLORS = {
    "cmpdesign, balanced, markers only": "#5b97d6",
    "cmpdesign, balanced": "#2f78c4",
    "cmpdesign, accurate": "#123f73",
    "the article's AGA corners": "#8a5a2b",
    "our stages 1 to 7 alone": "#b9b9b9",
    "cornerSubPix on our ids": "#777777",
    "OpenCV findChessboardCornersSB": "#c0392b",
    "OpenCV findChessboardCorners + cornerSubPix": "#e58a3a",
    "chess-corners, saddle point, on ours": "#c5e1a5",
    "chess-corners, its default": "#8bc34a",
    "chess-corners, saddle point": "#2e7d32",
}
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
        "1.7 times the time to import numpy and OpenCV, 58 MB",
        "startup",
    ),
)
MIN_FOUND = 0.5  # of the markers; methods with a smaller share are not drawn


def scene_table(scene: str, results: Sequence[MethodResult], caption: str) -> Table:
    """One scene's results."""
    rows = [
        (
            r.method, r.found_share, r.wrong, r.inner_px, r.inner_px / r.bound_px, r.all_px, r.all_px / r.all_bound_px,
            r.bias_px, r.ms, r.ratio,
        )
        for r in results
        if r.scene == scene
    ]  # fmt: skip
    return Table(scene, COLUMNS, rows, caption)


def methods_table(results: Sequence[MethodResult]) -> Table:
    """One row per method: the standard scene, and the worst of all scenes."""
    rows = []
    for method in METHODS:
        of_method = [r for r in results if r.method == method.name]
        flat = next(r for r in of_method if r.scene == "flat")
        worst = max(of_method, key=lambda r: r.inner_px / r.bound_px)
        rows.append((
            method.name, "checkerboard" if method.board else "pattern", min(r.found_share for r in of_method),
            sum(r.wrong for r in of_method), flat.inner_px, flat.inner_px / flat.bound_px,
            f"{worst.inner_px / worst.bound_px:.2f}, {worst.scene}", flat.ms, flat.ratio,
        ))  # fmt: skip
    return Table("", PAGE_COLUMNS, rows)


def pooled_table(results: Sequence[PooledResult], caption: str = "") -> Table:
    """The pooled results, one row per method."""
    rows = [
        (
            r.method, r.scenes, r.found_share, r.wrong, r.rms_px, r.rms_px / r.bound_px, r.inner_px,
            r.inner_px / r.inner_bound_px, r.z, r.ms,
        )
        for r in results
    ]  # fmt: skip
    return Table("pooled", POOLED_COLUMNS, rows, caption)


def page(measured: Mapping[str, Any]) -> Page:
    """Blocks and picture from the content of docs/measured/comparison.json."""
    results = [MethodResult(**row) for row in measured["results"]]
    pooled = [PooledResult(**row) for row in measured["pooled"]]
    blocks = {
        "comparison": methods_table(results).markdown(),
        "comparison-pooled": pooled_table(pooled).markdown(),
        "conditions": conditions_text(measured["conditions"]),
        "figures": key_figures(results).markdown(),
        "speed": f"{preset_times(results).markdown()}\n\nPrinted by `python -m benchmarks.comparison`.",
    }
    return Page(blocks, {"speed-error.png": comparison_picture(results)})


def _flat(results: Sequence[MethodResult], preset: str) -> MethodResult:
    return next(r for r in results if (r.method, r.scene) == (f"cmpdesign, {preset}", "flat"))


def preset_times(results: Sequence[MethodResult]) -> Table:
    """The table of docs/how-to/speed.md: the time and the error of every preset in the standard scene."""
    flats = [(f"`{preset}`", _flat(results, preset)) for preset in PRESETS]
    columns = {"preset": TEXT, "time of 397 markers, ms": ".1f", "error of the exact bound": ".2f"}
    return Table("", columns, [(name, flat.ms, flat.inner_px / flat.bound_px) for name, flat in flats])


def key_figures(results: Sequence[MethodResult]) -> Table:
    """The table of README: what is measured, and the command that prints it."""
    rows = []
    for preset in PRESETS:
        flat = _flat(results, preset)
        of_bound = f"{flat.inner_px / flat.bound_px:.2f} of the [exact bound](docs/explanation/accuracy.md)"
        figure = f"{flat.inner_px:.4f} px RMS per axis, {of_bound}; {flat.ms:.1f} ms"
        rows.append((f"397 markers at 20 px, preset `{preset}`", figure, "comparison"))
    named = [(what, figure, f"`python -m benchmarks.{name}`") for what, figure, name in [*rows, *STATED]]
    return Table("", {"measured": TEXT, "figure": TEXT, "printed by": TEXT}, named)


def comparison_picture(results: Sequence[MethodResult]) -> bytes:
    """PNG: time against error, both logarithmic; one color per method, one mark per scene, the bounds as lines."""
    plt = pyplot()
    from matplotlib.lines import Line2D

    figure, axis = plt.subplots(figsize=(9.2, 4.8))
    drawn = [r for r in results if r.found_share >= MIN_FOUND]
    for r in drawn:
        axis.plot(
            r.ms, r.inner_px, MARKS[r.scene], color=COLORS[r.method], markersize=8, markeredgecolor="white"
        )
    flat = {r.method: r for r in drawn if r.scene == "flat"}
    for board, words in ((False, "bound of the pattern"), (True, "bound of the checkerboard")):
        bound = next(flat[m.name].bound_px for m in METHODS if m.board == board and m.name in flat)
        axis.axhline(bound, color="#444444", linestyle="--" if board else "-", linewidth=1)
        axis.annotate(
            words, (1.0, bound), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7
        )
    axis.set(
        xscale="log", yscale="log", xlabel="time, ms an image, one core", ylabel="RMS error per axis, px"
    )
    axis.grid(True, which="both", alpha=0.25)
    methods = [Line2D([], [], color=COLORS[name], marker="o", linestyle="", label=name) for name in flat]
    scenes = [Line2D([], [], color="#444444", marker=MARKS[name], linestyle="", label=name) for name in MARKS]
    figure.subplots_adjust(left=0.08, right=0.64, top=0.97, bottom=0.12)
    style = {"fontsize": 8, "frameon": False}
    figure.legend(handles=methods, loc="upper left", bbox_to_anchor=(0.65, 0.98), **style)
    figure.legend(handles=scenes, loc="lower left", bbox_to_anchor=(0.65, 0.1), **style)
    return png_of(figure)
