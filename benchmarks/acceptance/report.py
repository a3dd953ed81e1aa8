"""The curve as a table for the terminal and the documentation, and as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.acceptance.points import MAX_LOST, MAX_WRONG, Point
from benchmarks.frame.plots import png_of, pyplot
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table

IMAGE = "acceptance.png"
BLUE, GREY = "#0072b2", "#444444"


def curve_table(points: Sequence[Point], own: Point) -> Table:
    """A row for each threshold."""
    columns = {"threshold, edges": TEXT, "reported": ",", "wrong ids": "d", "wrong positions": "d"}
    columns |= {"per million": ".1f", "95 % below": ".1f", "lost": ",", "of today's": ".3f"}
    rows = [
        (
            f"{one.threshold:g}{' (today)' * (one == own)}", one.reported, one.wrong_ids, one.wrong_positions,
            one.wrong_per_million, one.upper_per_million, one.lost, one.lost / own.lost,
        )
        for one in points
    ]  # fmt: skip
    holds = ", ".join(f"{one.threshold:g}" for one in points if one.holds(own))
    return Table("wrong positions against lost markers", columns, rows, f"holds: {holds or 'none'}")


def own_point(measured: Mapping[str, Any]) -> Point:
    """The point of the reader's own threshold."""
    return next(one for one in measured_points(measured) if one.threshold == measured["own"])


def measured_points(measured: Mapping[str, Any]) -> list[Point]:
    """The points of the content of docs/measured/acceptance.json."""
    return [Point(**entry) for entry in measured["points"]]


def page(measured: Mapping[str, Any]) -> Page:
    """The block and the picture from the content of docs/measured/acceptance.json."""
    table = curve_table(measured_points(measured), own_point(measured)).markdown()
    picture = f"![Wrong positions against lost markers](../images/{IMAGE})"
    written = f"Written by `{measured['command']}`: {measured['pictures']:,} pictures."
    return Page({"acceptance": f"{picture}\n\n{table}\n\n{written}"}, {IMAGE: curve_picture(measured)})


def curve_picture(measured: Mapping[str, Any]) -> bytes:
    """PNG: over the threshold, wrong positions a million with their upper bounds, and lost markers over today's."""
    plt = pyplot()

    points, own = measured_points(measured), own_point(measured)
    at = [one.threshold for one in points]
    share = [one.wrong_per_million for one in points]
    above = [one.upper_per_million - one.wrong_per_million for one in points]
    figure, (wrong, lost) = plt.subplots(2, 1, sharex=True, figsize=(7.2, 4.4))
    wrong.errorbar(at, share, yerr=[[0.0] * len(above), above], fmt="o", color=BLUE, capsize=4, markersize=5)
    wrong.axhline(MAX_WRONG, color=GREY, linestyle="--", linewidth=1)
    wrong.set(ylabel="wrong a million,\n95 % below", ylim=(0, 1.2 * MAX_WRONG))
    lost.plot(at, [one.lost / own.lost for one in points], "o-", color=BLUE, markersize=5)
    lost.axhline(MAX_LOST, color=GREY, linestyle="--", linewidth=1)
    lost.set(
        xscale="log", xlabel="threshold, edges; the reader's own is dotted", ylabel="lost,\nover today's"
    )
    lost.set_xticks(at, [f"{value:g}" for value in at])
    lost.minorticks_off()
    for axis in (wrong, lost):
        axis.axvline(own.threshold, color=GREY, linestyle=":", linewidth=1)
        axis.grid(alpha=0.25)
    figure.tight_layout()
    return png_of(figure)
