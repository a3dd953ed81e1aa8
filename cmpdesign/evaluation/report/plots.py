"""The plots of the reports, as SVG texts; the same figures give the same bytes."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from cmpdesign.libraries import extra

COLORS = {
    "square": "#59636b",
    "square_saddles": "#a3adb5",
    "multicolor_unrefined": "#8fb3dd",
    "multicolor": "#2f6fb7",
    "multicolor_repair": "#2e8b57",
}
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "cmpdesign",
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.spines.top": False,
}
STYLE |= {"axes.spines.right": False, "font.family": "sans-serif", "legend.frameon": False}


@contextmanager
def _open_figure(width: float, height: float) -> Iterator[tuple[Any, Callable[[], str]]]:
    """A figure's axes, and the function that returns it as SVG."""
    with extra("evaluate"):
        import matplotlib
        from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure.subplots(), lambda: _figure_svg(figure)


def _figure_svg(figure: Any) -> str:
    """The figure as an SVG element, without the XML header, for a page."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def plot_success_rates(groups: Mapping[str, Mapping[str, Mapping[str, Any]]], methods: Sequence[str]) -> str:
    """Success rates with their 95 % intervals, one group of bars per mode, the article's rates as rings."""
    with _open_figure(8.0, 3.2) as (axes, draw):
        width = 0.8 / len(methods)
        for i, method in enumerate(methods):
            for g, mode in enumerate(groups.values()):
                x, result = g + (i - (len(methods) - 1) / 2) * width, mode[method]
                share = 100 * result["share"]
                low, high = (100 * limit for limit in result["interval_95"])
                label = method.replace("_", " ") if g == 0 else None
                axes.bar(x, share, 0.9 * width, color=COLORS[method], label=label)
                axes.plot([x, x], [low, high], color="#1c2126", lw=1)
                if "article" in result:
                    axes.plot(x, 100 * result["article"]["share"], "o", mfc="none", mec="#b2182b", ms=6)
        axes.plot([], [], "o", mfc="none", mec="#b2182b", ms=6, ls="", label="the article, 10 trials")
        axes.set_xticks(range(len(groups)), [mode.replace("_", " ") for mode in groups])
        axes.set_ylabel("successful, %")
        axes.set_ylim(0, 105)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return draw()


def plot_values(groups: Mapping[str, Mapping[str, Sequence[float]]], unit: str) -> str:
    """Every value as a dot and the mean as a line, by group and method."""
    with _open_figure(7.0, 3.0) as (axes, draw):
        for g, methods in enumerate(groups.values()):
            for i, (method, values) in enumerate(methods.items()):
                x = g + 0.3 * (i - (len(methods) - 1) / 2)
                spread = [x + 0.02 * (k - (len(values) - 1) / 2) for k in range(len(values))]
                label = method.replace("_", " ") if g == 0 else None
                axes.plot(spread, values, "o", color=COLORS[method], ms=3.5, alpha=0.8, label=label)
                if values:
                    mean = sum(values) / len(values)
                    axes.plot([x - 0.12, x + 0.12], [mean, mean], color=COLORS[method], lw=2)
        axes.set_xticks(range(len(groups)), [name.replace("_", " ") for name in groups])
        axes.set_ylabel(unit)
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return draw()


def plot_bars(groups: Mapping[str, Mapping[str, float | None]], unit: str) -> str:
    """One bar per method in every group."""
    with _open_figure(7.0, 3.0) as (axes, draw):
        for g, methods in enumerate(groups.values()):
            width = 0.8 / len(methods)
            for i, (method, value) in enumerate(methods.items()):
                label = method.replace("_", " ") if g == 0 else None
                x = g + (i - (len(methods) - 1) / 2) * width
                axes.bar(x, value or 0.0, 0.9 * width, color=COLORS[method], label=label)
        axes.set_xticks(range(len(groups)), [name.replace("_", " ") for name in groups])
        axes.set_ylabel(unit)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return draw()


def plot_lost_angles(measured: Mapping[int, Mapping[int, float | None]], formula: Mapping[int, float]) -> str:
    """The first angle lost over the cell's size, one line per shape, the formula's limit dashed."""
    shades = ("#2f6fb7", "#59636b", "#b2182b")
    with _open_figure(6.0, 3.0) as (axes, draw):
        for shade, (sides, found) in zip(shades, measured.items(), strict=True):
            points = [(size, angle) for size, angle in found.items() if angle is not None]
            axes.plot(*zip(*points, strict=True), "o-", color=shade, ms=4, label=f"n = {sides}")
            axes.axhline(formula[sides], color=shade, ls="--", lw=0.8)
        sizes = sorted({size for found in measured.values() for size in found})
        axes.set_xscale("log")
        axes.set_xticks(sizes, [str(size) for size in sizes])
        axes.set_xticks([], minor=True)
        axes.set_xlabel("edge, px")
        axes.set_ylabel("first angle lost, degrees")
        axes.set_ylim(bottom=0)
        axes.legend()
        return draw()


def plot_error_over_density(points: Mapping[str, tuple[float, float]]) -> str:
    """Designs by markers per cm2 and error in micrometres."""
    with _open_figure(6.0, 3.4) as (axes, draw):
        for name, (density, error) in points.items():
            axes.plot(density, error, "o", color=COLORS["multicolor"], ms=6)
            axes.annotate(name, (density, error), xytext=(6, 4), textcoords="offset points")
        axes.set_xlabel("markers per cm²")
        axes.set_ylabel("surface error, RMS, µm")
        axes.margins(0.2)
        axes.set_ylim(bottom=0)
        return draw()
