"""Cold extraction: the growth of its time with the pixels and with the markers, stage by stage.

One core, every image new to the extractor (no previous frame is used), blur 1 px, noise 2/255. Found markers are
counted too; ``benchmarks.accuracy`` measures their precision, ``benchmarks.comparison`` the time of the presets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
from benchmarks.suites.scenes import WRONG_SHARE, cached_reference, shortest_edges
from benchmarks.suites.scoring.wrong import wrong_markers
from cmpdesign.scene import Camera, render, standard_layout, standard_scene
from extractor import Extractor, Status

LAYERS = 10
PITCH_PX = 20.0
PIXELS_MP = (0.3, 0.6, 1.2, 2.4, 4.8, 8.0, 12.0, 20.0)
MARKER_LAYERS = (3, 5, 8, 12, 18, 27, 41, 64, 99)  # 37 to 29,701 markers
MARGIN, BORDER_PX = 1.02, 40  # a picture is this factor larger than its pattern, plus this border
Unit = Literal["megapixels", "markers"]


@dataclass(frozen=True)
class Speed:
    """Times of one scene: milliseconds in total and by stage."""

    name: str
    megapixels: float
    markers: int
    measured: int
    wrong: int
    median_ms: float
    best_ms: float
    stages_ms: dict[str, float]


def measure_speed(name: str, layers: int, pitch_px: float, size: tuple[int, int], runs: int) -> Speed:
    """Time the extraction of one scene, after two runs that are not timed."""
    layout = standard_layout("honeycomb", layers)
    rendered = render(replace(standard_scene(layout), camera=Camera(pitch_px, rotation_deg=7.3)), size=size)
    extractor = Extractor(cached_reference("honeycomb", layers))
    read = [timed(lambda: extractor.extract(rendered.image)) for _ in range(2 + runs)]
    total, stages = [one.clock_ms for one in read], [one.result.timings_ms for one in read]
    markers = read[-1].result
    true_px = rendered.truth.marker_xy_px
    measured = markers.status == Status.MEASURED
    off = wrong_markers(markers, true_px, WRONG_SHARE * shortest_edges(layout, true_px)).any_kind
    return Speed(
        name, size[0] * size[1] / 1e6, int(rendered.truth.visible.sum()), int(measured.sum()),
        int((off & measured).sum()), float(np.median(total[2:])), min(total[2:]),
        {stage: float(np.median([run[stage] for run in stages[2:]])) for stage in stages[2]},
    )  # fmt: skip


def image_size_px(megapixels: float) -> tuple[int, int]:
    """Width and height in px of a 4 : 3 image."""
    height = round((megapixels * 1e6 * 3 / 4) ** 0.5)
    return round(height * 4 / 3), height


def picture_px(layers: int) -> tuple[int, int]:
    """Width and height in px of an image of a whole pattern."""
    side = round(2 * layers * PITCH_PX * MARGIN) + BORDER_PX
    return side, side


def fit_exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of log y over log x: 1 is linear growth."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def growth(results: Sequence[Speed], unit: Unit) -> dict[str, float]:
    """Exponents of the best times, over all sizes and over the larger half."""
    x, y = [getattr(result, unit) for result in results], [result.best_ms for result in results]
    large = len(results) // 2
    return {"exponent": fit_exponent(x, y), "exponent_large": fit_exponent(x[large:], y[large:])}


def growth_tables(title: str, results: Sequence[Speed], grown: dict[str, float]) -> tuple[Table, Table]:
    """The times, and the stages at the largest size, the slowest first."""
    rows = [
        (r.name, r.megapixels, f"{r.measured}/{r.markers}", r.wrong, r.median_ms, r.best_ms) for r in results
    ]
    columns = {"scene": TEXT, "MP": ".2f", "measured": "", "wrong": "d", "median ms": ".1f", "best ms": ".1f"}
    caption = f"exponent {grown['exponent']:.2f}, {grown['exponent_large']:.2f} over the larger half"
    largest = results[-1]
    stages = sorted(largest.stages_ms.items(), key=lambda pair: -pair[1])
    shares = [(stage, ms, ms / largest.median_ms) for stage, ms in stages]
    of_largest = Table(f"stages, {largest.name}", {"stage": TEXT, "ms": ".1f", "share": ".1%"}, shares)
    return Table(title, columns, rows, caption), of_largest


def page(results: dict[str, Any]) -> Page:
    """The tables of docs/explanation/accuracy.md, by block."""
    found = {}
    for name, key, unit in (("pixels", "over_pixels", "megapixels"), ("markers", "over_markers", "markers")):
        rows, grown = results[key], results["growth"][unit]
        head = "MP" if unit == "megapixels" else "markers"
        lines = [
            f"| {head} | {' | '.join(f'{r[unit]:.0f}' if r[unit] > 30 else f'{r[unit]:.1f}' for r in rows)} |",
            "|---" * (len(rows) + 1) + "|",
        ]
        lines.append(f"| ms | {' | '.join(format(r['best_ms'], '.1f') for r in rows)} |")
        slowest = sorted(rows[-1]["stages_ms"].items(), key=lambda pair: -pair[1])[:4]
        total = rows[-1]["median_ms"]
        words = ", ".join(f"`{stage}` {ms / total:.0%}" for stage, ms in slowest)
        lines += ["", f"Exponent {grown['exponent']:.2f}; over the larger half {grown['exponent_large']:.2f}. "
                  f"At the largest: {words}."]  # fmt: skip
        found[f"scaling-{name}"] = "\n".join(lines)
    return Page(found)


def measure(quick: bool = False) -> Shown:
    """Growth with the pixels, 331 markers that grow along; with the markers, edges of 20 px in growing images.

    Args:
        quick: few runs.
    """
    runs = 3 if quick else 5
    sizes = [(mp, image_size_px(mp)) for mp in PIXELS_MP]
    pixels = [measure_speed(f"{mp:g} MP", LAYERS, PITCH_PX * size[1] / 480, size, runs) for mp, size in sizes]
    markers = [measure_speed(f"{n} layers", n, PITCH_PX, picture_px(n), runs) for n in MARKER_LAYERS]
    grown = {"megapixels": growth(pixels, "megapixels"), "markers": growth(markers, "markers")}
    yield from growth_tables("growth with the image", pixels, grown["megapixels"])
    yield from growth_tables("growth with the markers", markers, grown["markers"])
    kept = {"over_pixels": [asdict(r) for r in pixels], "over_markers": [asdict(r) for r in markers]}
    return Found({**kept, "growth": grown})


main = Experiment("extraction", measure, page)
main.run_as(__name__)
