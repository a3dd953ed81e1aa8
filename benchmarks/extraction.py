"""Cold extraction: how long, how precise, and how both grow.

    python -m benchmarks.extraction [--quick] [--json FILE]

One core, warm code, every image new to the extractor (no previous frame is used). Errors are per axis, against the
scene's truth; the bound is the Cramer-Rao bound of the same scene and the same markers.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = (
    "1"  # before numpy and numba: times are of one core
)
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also as a script, from anywhere

import cv2
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.machine import sentence, write_json
from cmpdesign.layout import Layout
from cmpdesign.scene import (
    Camera,
    Press,
    Rendered,
    Scene,
    composed,
    cramer_rao,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.writers.layout_file import layout_to_json
from extractor import Extractor, Markers, Status, parse_layout
from extractor.refine import PRESETS, Preset

LAYERS = 10
PITCH_PX = 20.0
SIZE = (640, 480)
WRONG_SHARE = 0.3
PATTERNS = ("honeycomb", "round", "elliptical")
# per state: tilt in degrees, and a press that moves the surface by a third of a pitch over three
STATES: dict[str, tuple[float, Press | None]] = {
    "flat": (0.0, None),
    "tilted 35": (35.0, None),
    "pressed": (0.0, Press(radius_mm=3.0, depth_mm=0.35)),
}
PIXELS_MP = (0.3, 0.6, 1.2, 2.4, 4.8, 8.0, 12.0)
MARKER_LAYERS = (3, 5, 8, 12, 18, 27, 41)


@dataclass(frozen=True)
class Accuracy:
    """Errors of one scene over several noises; rms in px per axis, the ratio over the bound of the same markers."""

    pattern: str
    state: str
    visible: int
    measured_share: float
    wrong: int
    rms_all_px: float
    rms_inner_px: float
    bound_all_px: float
    bound_inner_px: float

    @property
    def ratio(self) -> float:
        return self.rms_inner_px / self.bound_inner_px


@dataclass(frozen=True)
class Speed:
    """Times of one scene: milliseconds in total and per stage."""

    name: str
    megapixels: float
    markers: int
    measured: int
    wrong: int
    median_ms: float
    p95_ms: float
    best_ms: float
    stages_ms: dict[str, float]


def extractor_of(layout: Layout, preset: Preset = "balanced") -> Extractor:
    return Extractor(parse_layout(layout_to_json(layout)), preset)


def scene_of(pattern: str, state: str, seed: int) -> Scene:
    tilt_deg, press = STATES[state]
    scene = standard_scene(standard_layout(pattern, LAYERS), seed=seed)
    camera = replace(scene.camera, tilt_deg=tilt_deg, tilt_axis_deg=30.0)
    return replace(scene, camera=camera, surface=composed(press) if press else None)


def inner_markers(layout: Layout) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """(M,) the markers within the last layer: six gridlines each."""
    return np.asarray(layout.marker_layer < layout.marker_layer.max())


def wrong_ids(layout: Layout, markers: Markers, rendered: Rendered) -> int:
    """Measured markers farther than 0.3 of their shortest edge from the truth."""
    true = rendered.truth.marker_xy_px
    ends = true[layout.edges]
    shortest = np.full(len(true), np.inf)
    for side in (0, 1):
        np.minimum.at(shortest, layout.edges[:, side], np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    measured = markers.status == Status.MEASURED
    away = np.hypot(*(markers.xy_px - true).T)
    return int((away[measured] > WRONG_SHARE * shortest[measured]).sum())


def accuracy(pattern: str, state: str, seeds: int) -> Accuracy:
    """Extract the same scene under several noises."""
    scene = scene_of(pattern, state, 0)
    layout, extractor = scene.layout, extractor_of(scene.layout)
    bound = cramer_rao(scene, size=SIZE)[:, [0, 1], [0, 1]]
    errors, wrong, measured = [], 0, 0
    for seed in range(seeds):
        rendered = render(replace(scene, seed=seed), size=SIZE)
        markers = extractor.extract(rendered.image)
        visible = rendered.truth.visible
        found = (markers.status == Status.MEASURED) & visible
        wrong += wrong_ids(layout, markers, rendered)
        measured += int(found.sum())
        errors.append(np.where(found[:, None], markers.xy_px - rendered.truth.marker_xy_px, np.nan))
    inner = inner_markers(layout) & visible

    def rms(squares: Any) -> float:
        return float(np.sqrt(np.nanmean(squares)))

    squares = np.square(errors)
    return Accuracy(
        pattern, state, int(visible.sum()), measured / (seeds * int(visible.sum())), wrong,
        rms(squares), rms(squares[:, inner]), rms(bound), rms(bound[inner]),
    )  # fmt: skip


def speed(
    name: str,
    layout: Layout,
    pitch_px: float,
    size: tuple[int, int],
    runs: int,
    preset: Preset = "balanced",
) -> Speed:
    """Time the extraction of one scene; two runs before the clock starts."""
    scene = standard_scene(layout)
    rendered = render(replace(scene, camera=Camera(pitch_px, rotation_deg=7.3)), size=size)
    extractor = extractor_of(layout, preset)
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


def side_px(megapixels: float) -> tuple[int, int]:
    """4 : 3."""
    height = round((megapixels * 1e6 * 3 / 4) ** 0.5)
    return round(height * 4 / 3), height


def over_pixels(runs: int) -> list[Speed]:
    """One pattern of 331 markers, the whole picture growing."""
    layout = standard_layout("honeycomb", LAYERS)
    sizes = [(mp, side_px(mp)) for mp in PIXELS_MP]
    return [speed(f"{mp:g} MP", layout, PITCH_PX * size[1] / 480, size, runs) for mp, size in sizes]


def over_markers(runs: int) -> list[Speed]:
    """One picture of 4.8 MP, the pattern's layers growing at the same pitch in px as long as they fit."""
    size = side_px(4.8)
    pitch_px = 0.46 * size[1] / MARKER_LAYERS[-1]
    return [
        speed(f"{n} layers", standard_layout("honeycomb", n), pitch_px, size, runs) for n in MARKER_LAYERS
    ]


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of log y over log x: 1 is linear growth."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def per_unit(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Intercept and slope of y over x."""
    slope, intercept = np.polyfit(x, y, 1)
    return float(intercept), float(slope)


def table_of(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> Table:
    table = Table(
        title=title, box=SIMPLE_HEAD, caption=caption or None, title_justify="left", caption_justify="left"
    )
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table


def accuracy_table(results: Sequence[Accuracy], seeds: int) -> Table:
    rows = [
        (
            f"{r.pattern}, {r.state}", f"{r.measured_share:.2%}", str(r.wrong), f"{r.rms_inner_px:.4f}",
            f"{r.bound_inner_px:.4f}", f"{r.ratio:.2f}", f"{r.rms_all_px:.4f}", f"{r.rms_all_px / r.bound_all_px:.2f}",
        )
        for r in results
    ]  # fmt: skip
    columns = ("RMS per axis, px", "measured", "wrong", "inner", "bound", "ratio", "all", "ratio")
    caption = f"{SIZE[0]} x {SIZE[1]} px, {LAYERS} layers, pitch {PITCH_PX:g} px, blur 1, noise 2/255; {seeds} noises"
    return table_of("Accuracy of a cold extraction", columns, rows, caption)


def speed_table(title: str, results: Sequence[Speed], caption: str) -> Table:
    rows = [
        (
            r.name, f"{r.megapixels:.2f}", f"{r.measured}/{r.markers}", str(r.wrong), f"{r.median_ms:.1f}",
            f"{r.p95_ms:.1f}", f"{r.best_ms:.1f}",
        )
        for r in results
    ]  # fmt: skip
    return table_of(
        title, ("scene", "MP", "measured", "wrong", "median ms", "p95 ms", "best ms"), rows, caption
    )


def stage_table(results: Sequence[Speed]) -> Table:
    names = list(dict.fromkeys(name for result in results for name in result.stages_ms))
    rows = [(name, *(f"{result.stages_ms.get(name, 0):.2f}" for result in results)) for name in names]
    rows.append(("total", *(f"{result.median_ms:.2f}" for result in results)))
    return table_of("Stages, median ms", ("stage", *(result.name for result in results)), rows)


def growth(results: Sequence[Speed], unit: Callable[[Speed], float]) -> dict[str, float]:
    """How the best times grow: the exponent, and milliseconds at zero and per unit."""
    x, y = [unit(result) for result in results], [result.best_ms for result in results]
    intercept, slope = per_unit(x, y)
    return {"exponent": exponent(x, y), "ms_at_zero": intercept, "ms_per_unit": slope}


def run(quick: bool) -> tuple[dict[str, Any], list[Table]]:
    """Everything, as data and as tables."""
    runs, seeds = (7, 2) if quick else (61, 12)
    usual = standard_layout("honeycomb", LAYERS)
    fast, standard, accurate = (
        speed(f"640x480, 331 markers, {preset}", usual, PITCH_PX, SIZE, 3 * runs, preset)
        for preset in PRESETS
    )
    large = speed(
        "12 MP, 20 layers", standard_layout("honeycomb", 20), 70.0, side_px(12.0), max(3, runs // 4)
    )
    precise = [accuracy(pattern, state, seeds) for pattern in PATTERNS for state in STATES]
    pixels, markers = over_pixels(max(3, runs // 6)), over_markers(max(3, runs // 6))
    by_pixels, by_markers = growth(pixels, lambda r: r.megapixels), growth(markers, lambda r: r.markers)
    results = {
        "standard": asdict(standard), "fast": asdict(fast), "accurate": asdict(accurate),
        "large": asdict(large), "accuracy": [asdict(r) for r in precise],
        "over_pixels": [asdict(r) for r in pixels], "over_markers": [asdict(r) for r in markers],
        "growth": {"megapixels": by_pixels, "markers": by_markers},
    }  # fmt: skip

    def grown(unit: str, fit: dict[str, float]) -> str:
        return (
            f"time ~ {unit}^{fit['exponent']:.2f} over this range; straight line through the best times: "
            f"{fit['ms_at_zero']:.1f} ms + {fit['ms_per_unit']:.3g} ms per {unit}"
        )

    tables = [
        speed_table(
            "Cold extraction",
            [fast, standard, accurate, large],
            "one core, warm code, honeycomb, blur 1 px, noise 2/255",
        ),
        stage_table([standard, large]),
        accuracy_table(precise, seeds),
        speed_table("Growth with the image: 331 markers that grow along", pixels, grown("MP", by_pixels)),
        speed_table("Growth with the markers: 4.8 MP, constant pitch", markers, grown("marker", by_markers)),
    ]
    return results, tables


def main(arguments: list[str] | None = None) -> int:
    """Run, print the tables, write the JSON file if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.extraction", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help="few runs: a look, no figures to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results too")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    results, tables = run(options.quick)
    terminal = Console()
    console = terminal if terminal.is_terminal else Console(width=100)  # a pipe has no width
    for table in tables:
        console.print(table)
    console.print(sentence(), style="dim", soft_wrap=True)
    if options.json:
        write_json(options.json, results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
