"""Cold extraction: its time, and the growth of the time with the pixels and with the markers, stage by stage.

One core, every image new to the extractor (no previous frame is used). Found markers are counted too;
``benchmarks.accuracy`` measures their precision.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scenes import WRONG_SHARE, shortest_edges
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Camera, Rendered, render, standard_layout, standard_scene
from extractor import Extractor, Markers, Status, parse_layout
from extractor.presets import PRESETS, Preset

LAYERS = 10
PITCH_PX = 20.0
SIZE = (640, 480)
PIXELS_MP = (0.3, 0.6, 1.2, 2.4, 4.8, 8.0, 12.0, 20.0)
MARKER_LAYERS = (3, 5, 8, 12, 18, 27, 41, 64, 99)  # 37 to 29,701 markers
MARGIN, BORDER_PX = 1.02, 40  # a picture is this factor larger than its pattern, plus this border


@dataclass(frozen=True)
class Speed:
    """Times of one scene: milliseconds in total and by stage."""

    name: str
    megapixels: float
    markers: int
    measured: int
    wrong: int
    median_ms: float
    p95_ms: float
    best_ms: float
    stages_ms: dict[str, float]


def make_extractor(layout: Layout, preset: Preset = "balanced") -> Extractor:
    """An extractor of a layout of this package."""
    return Extractor(parse_layout(layout_to_json(layout)), preset)


def wrong_ids(layout: Layout, markers: Markers, rendered: Rendered) -> int:
    """The number of measured markers with an error above 0.3 of their shortest edge."""
    true = rendered.truth.marker_xy_px
    measured = markers.status == Status.MEASURED
    error_px = np.hypot(*(markers.xy_px - true).T)
    return int((error_px[measured] > WRONG_SHARE * shortest_edges(layout, true)[measured]).sum())


def measure_speed(
    name: str,
    layout: Layout,
    pitch_px: float,
    size: tuple[int, int],
    runs: int,
    preset: Preset = "balanced",
) -> Speed:
    """Time the extraction of one scene, after two runs that are not timed."""
    scene = standard_scene(layout)
    rendered = render(replace(scene, camera=Camera(pitch_px, rotation_deg=7.3)), size=size)
    extractor = make_extractor(layout, preset)
    for _ in range(2):
        markers = extractor.extract(rendered.image)
    total, stages = [], []
    for _ in range(runs):
        start = time.perf_counter()
        markers = extractor.extract(rendered.image)
        total.append(1e3 * (time.perf_counter() - start))
        stages.append(dict(markers.timings_ms))
    return Speed(
        name, size[0] * size[1] / 1e6, int(rendered.truth.visible.sum()),
        int((markers.status == Status.MEASURED).sum()), wrong_ids(layout, markers, rendered),
        float(np.median(total)), float(np.percentile(total, 95)), min(total),
        {stage: float(np.median([run[stage] for run in stages])) for stage in stages[0]},
    )  # fmt: skip


def image_size_px(megapixels: float) -> tuple[int, int]:
    """Width and height in px of a 4 : 3 image."""
    height = round((megapixels * 1e6 * 3 / 4) ** 0.5)
    return round(height * 4 / 3), height


def measure_over_pixels(runs: int) -> list[Speed]:
    """One pattern of 331 markers in images of increasing size."""
    layout = standard_layout("honeycomb", LAYERS)
    sizes = [(mp, image_size_px(mp)) for mp in PIXELS_MP]
    return [measure_speed(f"{mp:g} MP", layout, PITCH_PX * size[1] / 480, size, runs) for mp, size in sizes]


def measure_over_markers(runs: int) -> list[Speed]:
    """Patterns of increasing layers with edges of 20 px, in images of the pattern's size."""
    return [
        measure_speed(f"{n} layers", standard_layout("honeycomb", n), PITCH_PX, picture_px(n), runs)
        for n in MARKER_LAYERS
    ]


def picture_px(layers: int) -> tuple[int, int]:
    """Width and height in px of an image of a whole pattern."""
    side = round(2 * layers * PITCH_PX * MARGIN) + BORDER_PX
    return side, side


def fit_exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of log y over log x: 1 is linear growth."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def fit_line(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Intercept and slope of y over x."""
    slope, intercept = np.polyfit(x, y, 1)
    return float(intercept), float(slope)


def speed_table(title: str, results: Sequence[Speed], caption: str) -> Table:
    rows = [
        (r.name, r.megapixels, f"{r.measured}/{r.markers}", r.wrong, r.median_ms, r.p95_ms, r.best_ms)
        for r in results
    ]
    columns = {"scene": TEXT, "MP": ".2f", "measured": "", "wrong": "d", "median ms": ".1f", "p95 ms": ".1f"}
    return Table(title, columns | {"best ms": ".1f"}, rows, caption)


def stage_table(results: Sequence[Speed]) -> Table:
    names = list(dict.fromkeys(name for result in results for name in result.stages_ms))
    rows = [(name, *(result.stages_ms.get(name, 0.0) for result in results)) for name in names]
    rows.append(("total", *(result.median_ms for result in results)))
    return Table("stages, median ms", {"stage": TEXT} | {result.name: ".2f" for result in results}, rows)


def growth(results: Sequence[Speed], unit: Callable[[Speed], float]) -> dict[str, Any]:
    """Exponents of the best times, over all sizes and over the larger half; by stage, over the larger half."""
    x, y = [unit(result) for result in results], [result.best_ms for result in results]
    large = len(results) // 2
    stages = {
        stage: fit_exponent(
            x[large:], [max(result.stages_ms.get(stage, 0.0), 1e-3) for result in results[large:]]
        )
        for stage in results[-1].stages_ms
    }
    intercept, slope = fit_line(x, y)
    return {
        "exponent": fit_exponent(x, y), "exponent_large": fit_exponent(x[large:], y[large:]), "stages": stages,
        "ms_at_zero": intercept, "ms_per_unit": slope,
    }  # fmt: skip


def growth_table(title: str, largest: Speed, grown: dict[str, Any]) -> Table:
    """The stages at the largest size, the slowest first."""
    rows = [
        (stage, ms, ms / largest.median_ms, grown["stages"][stage])
        for stage, ms in sorted(largest.stages_ms.items(), key=lambda pair: -pair[1])
    ]
    return Table(title, {"stage": TEXT, "ms": ".1f", "share": ".1%", "exponent": ".2f"}, rows)


def growth_text(unit: str, grown: dict[str, Any]) -> str:
    """The caption of a table on growth."""
    return (
        f"time ~ {unit}^{grown['exponent']:.2f}, ^{grown['exponent_large']:.2f} over the larger half; straight line "
        f"through the best times: {grown['ms_at_zero']:.1f} ms + {grown['ms_per_unit']:.3g} ms per {unit}"
    )


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
    """Presets, then growth with the pixels and with the markers.

    Args:
        quick: few runs.
    """
    runs = 7 if quick else 31
    few = max(3, runs // 6)
    usual = standard_layout("honeycomb", LAYERS)
    presets = [measure_speed(preset, usual, PITCH_PX, SIZE, 3 * runs, preset) for preset in PRESETS]
    large = measure_speed(
        "12 MP", standard_layout("honeycomb", 20), 70.0, image_size_px(12.0), max(3, runs // 4)
    )
    pixels, markers = measure_over_pixels(few), measure_over_markers(few)
    by_pixels, by_markers = growth(pixels, lambda r: r.megapixels), growth(markers, lambda r: r.markers)
    told = "presets at 640 x 480 px; one core, warm code, blur 1 px, noise 2/255"
    yield speed_table("cold extraction", [*presets, large], told)
    yield stage_table([*presets, large])
    title = "growth with the image: 331 markers that grow along"
    yield speed_table(title, pixels, growth_text("MP", by_pixels))
    yield growth_table(f"stages at {pixels[-1].megapixels:.0f} MP", pixels[-1], by_pixels)
    title = "growth with the markers: edges of 20 px, the image grows along"
    yield speed_table(title, markers, growth_text("marker", by_markers))
    yield growth_table(f"stages at {markers[-1].markers} markers", markers[-1], by_markers)
    return Found(
        {
            "presets": {preset: asdict(result) for preset, result in zip(PRESETS, presets, strict=True)},
            "large": asdict(large),
            "over_pixels": [asdict(r) for r in pixels],
            "over_markers": [asdict(r) for r in markers],
            "growth": {"megapixels": by_pixels, "markers": by_markers},
        }
    )


main = Experiment("extraction", measure, page)

if __name__ == "__main__":
    raise SystemExit(main())
