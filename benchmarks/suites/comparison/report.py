"""The comparison as a table on the terminal, as Markdown and as a picture."""

from __future__ import annotations

import io
from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table

from benchmarks.suites.comparison.measure import MethodResult
from benchmarks.suites.comparison.methods import METHODS
from benchmarks.suites.comparison.pooled import PooledResult

COLUMNS = (
    "method",
    "found",
    "wrong",
    "inner px",
    "/ bound",
    "all px",
    "/ bound",
    "bias px",
    "ms",
    "time / SB",
)
POOLED_COLUMNS = (
    "method",
    "scenes",
    "found",
    "wrong",
    "RMS px",
    "of the bound",
    "inner px",
    "of the bound",
    "z",
    "ms",
)
MARKS = {
    "flat": "o", "tilt": "^", "bulge": "s", "twist": "D", "blur 1.6 px": "v", "pitch 13 px": "*", "round": "h",
    "elliptical": "p",
}  # fmt: skip
COLORS = {
    "cmpdesign, fast, markers only": "#a9d3f5",
    "cmpdesign, fast": "#7fb3e6",
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
MIN_FOUND = 0.5  # of the markers; methods with a smaller share are not drawn


def scene_table(scene: str, results: Sequence[MethodResult], caption: str = "") -> Table:
    """One scene's results, for the terminal."""
    table = Table(
        title=scene, box=SIMPLE_HEAD, caption=caption or None, title_justify="left", caption_justify="left"
    )
    for number, column in enumerate(COLUMNS):
        table.add_column(column, justify="right" if number else "left", no_wrap=True)
    for r in results:
        if r.scene == scene:
            table.add_row(
                r.method, f"{r.found_share:.1%}", str(r.wrong), f"{r.inner_px:.4f}",
                f"{r.inner_px / r.bound_px:.2f}", f"{r.all_px:.4f}", f"{r.all_px / r.all_bound_px:.2f}",
                f"{r.bias_px:.4f}", f"{r.ms:.1f}", f"{r.ratio:.3f}",
            )  # fmt: skip
    return table


def comparison_markdown(results: Sequence[MethodResult]) -> str:
    """One row per method: the standard scene, and the worst of all scenes."""
    lines = [
        "| method | reads | found | wrong | RMS px | of the bound | worst scene | ms | of SB's time |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for method in METHODS:
        of_method = [r for r in results if r.method == method.name]
        flat = next(r for r in of_method if r.scene == "flat")
        worst = max(of_method, key=lambda r: r.inner_px / r.bound_px)
        cells = (
            method.name, "checkerboard" if method.board else "pattern", f"{min(r.found_share for r in of_method):.0%}",
            str(sum(r.wrong for r in of_method)), f"{flat.inner_px:.4f}", f"{flat.inner_px / flat.bound_px:.2f}",
            f"{worst.inner_px / worst.bound_px:.2f}, {worst.scene}", f"{flat.ms:.1f}", f"{flat.ratio:.2f}",
        )  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def pooled_table(results: Sequence[PooledResult], caption: str = "") -> Table:
    """The pooled results, for the terminal."""
    table = Table(
        title="pooled", box=SIMPLE_HEAD, caption=caption or None, title_justify="left", caption_justify="left"
    )
    for number, column in enumerate(POOLED_COLUMNS):
        table.add_column(column, justify="right" if number else "left", no_wrap=True)
    for r in results:
        table.add_row(*_pooled_cells(r))
    return table


def pooled_markdown(results: Sequence[PooledResult]) -> str:
    """One row per method."""
    rows = [POOLED_COLUMNS, ("---",) * len(POOLED_COLUMNS), *map(_pooled_cells, results)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _pooled_cells(r: PooledResult) -> tuple[str, ...]:
    return (
        r.method, f"{r.scenes}", f"{r.found_share:.1%}", f"{r.wrong}", f"{r.rms_px:.4f}",
        f"{r.rms_px / r.bound_px:.2f}", f"{r.inner_px:.4f}", f"{r.inner_px / r.inner_bound_px:.2f}",
        "" if r.z is None else f"{r.z:.2f}", f"{r.ms:.1f}",
    )  # fmt: skip


def comparison_picture(results: Sequence[MethodResult]) -> bytes:
    """PNG: time against error, both logarithmic; one color per method, one mark per scene, the bounds as lines."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.lines import Line2D

    figure, axis = pyplot.subplots(figsize=(9.2, 4.8))
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
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=100, metadata={"Software": None})
    pyplot.close(figure)
    return data.getvalue()
