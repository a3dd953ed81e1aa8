"""Rendering: its time, and its own error against an independent reference.

    python -m benchmarks.rendering [--quick] [--json FILE]

Scenes of 640x480 and 331 markers: flat, seen through a distorting lens, pressed by a ball (a solved contact, seen from
the back), and that in the two halves of a virtual binocular. Blur 1 px and none, no noise. For its time only, a steep
dent that hides a part of itself.

The reference (``benchmarks.support.scanlines``) shares no step with the renderer. The reference is inexact for sides
along its scan lines, so the patterns are rotated by 30 degrees, the flat one by 7.3. The error in grey levels is that
of a linear 16-bit image, in 8-bit units. The error in px is the shift of the gridlines' middles along their normals
with which the reference fits the image best. Times are those of sRGB images. One core.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also as a script, from anywhere

import cv2
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.support.machine import conditions_text, write_json
from benchmarks.support.scanlines import ImageWindow, RenderError, measure_render_error
from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.scene import Dent, Pinhole, Scene, composed, render, standard_layout, standard_scene

SIZE = (640, 480)
REPEATS, QUICK_REPEATS = 40, 5
LIMIT_MS = {"flat": 50.0, "pressed": 120.0, "steep, parts hidden": 120.0}  # of CPU time, the median
TURN_DEG = 30.0
BARREL = (-0.2, 0.05, 0.001, -0.002, 0.0)


@dataclass(frozen=True)
class Speed:
    """Times of one picture in ms: median and 95th percentile of wall time, and median of CPU time."""

    name: str
    p50_ms: float
    p95_ms: float
    cpu_ms: float


def make_scenes(grid: int = 256) -> dict[str, Scene]:
    """The scenes whose error is measured, by name; the flat one is the standard scene with 10 layers."""
    layout = standard_layout(layers=10)
    flat = standard_scene(layout)
    contact = solve(Elastomer(3.0, 0.2), Ball(6.0), Motion(0.6, (0.4, 0.0), 8.0), size_mm=(24, 22), grid=grid)
    back = Pinhole.looking(
        SIZE, distance_mm=36, field_of_view_deg=42, tilt_deg=8, roll_deg=TURN_DEG, back=True
    )
    lens = Pinhole.looking(
        SIZE, distance_mm=32, field_of_view_deg=48, tilt_deg=12, roll_deg=TURN_DEG, distortion=BARREL
    )
    halves = [
        Pinhole.looking(
            SIZE,
            distance_mm=46,
            field_of_view_deg=30,
            tilt_deg=14,
            azimuth_deg=azimuth,
            roll_deg=TURN_DEG,
            back=True,
            mirror=True,
            area_px=(x, 0, 320, 480),
        )
        for azimuth, x in ((180, 0), (0, 320))
    ]
    surface = contact.surface()
    return {
        "flat": flat,
        "distorted": replace(flat, camera=lens),
        "pressed": replace(flat, camera=back, surface=surface),
        "pressed, two views": replace(flat, camera=tuple(halves), surface=surface),
    }


def steep_scene(flat: Scene) -> Scene:
    """A dent viewed from the side: half a percent of the pattern turns away."""
    camera = Pinhole.looking(
        SIZE, distance_mm=36, field_of_view_deg=42, tilt_deg=50, roll_deg=TURN_DEG, back=True
    )
    return replace(flat, camera=camera, surface=composed(Dent(1.2, 2.0, (0.3, 0.4))))


def measure_speed(name: str, scene: Scene, repeats: int) -> Speed:
    """Time a scene with the blur and noise of the standard scene, after one picture that is not timed."""
    render(scene, size=SIZE)
    wall, cpu = [], []
    for _ in range(repeats):
        before = time.perf_counter(), time.process_time()
        render(scene, size=SIZE)
        wall.append(1e3 * (time.perf_counter() - before[0]))
        cpu.append(1e3 * (time.process_time() - before[1]))
    return Speed(name, float(np.median(wall)), float(np.percentile(wall, 95)), float(np.median(cpu)))


def result_tables(errors: Sequence[RenderError], speeds: Sequence[Speed]) -> list[Table]:
    error_table = Table(box=SIMPLE_HEAD, title="the renderer's own error, linear pictures")
    for heading in ("scene", "blur px", "grey RMS", "largest", "edge RMS px", "largest", "gridlines"):
        error_table.add_column(heading, justify="left" if heading == "scene" else "right")
    for error in errors:
        error_table.add_row(
            error.name,
            f"{error.blur_px:g}",
            f"{error.grey_rms:.4f}",
            f"{error.grey_largest:.3f}",
            f"{error.edge_rms_px:.6f}",
            f"{error.edge_largest_px:.6f}",
            f"{error.edges}",
        )
    speed_table = Table(
        box=SIMPLE_HEAD, title="time of a picture, 640x480, 331 markers, blur 1 px, sRGB, noise 2/255"
    )
    for heading in ("scene", "p50 ms", "p95 ms", "CPU p50 ms"):
        speed_table.add_column(heading, justify="left" if heading == "scene" else "right")
    for speed in speeds:
        speed_table.add_row(speed.name, *(f"{v:.1f}" for v in (speed.p50_ms, speed.p95_ms, speed.cpu_ms)))
    return [error_table, speed_table]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer repetitions and a smaller window")
    parser.add_argument("--json", type=Path, help="also write the results here")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    window = ImageWindow(260, 180, 120, 120) if options.quick else ImageWindow(220, 140, 200, 200)
    scenes = make_scenes()
    # The first of the two views is the left half.
    windows = {name: window if "two" not in name else replace(window, x=80, width=120) for name in scenes}
    errors = [
        measure_render_error(name, scene, blur_px, windows[name], SIZE)
        for name, scene in scenes.items()
        for blur_px in (1.0, 0.0)
    ]
    timed = {**scenes, "steep, parts hidden": steep_scene(scenes["flat"])}
    speeds = [
        measure_speed(name, scene, QUICK_REPEATS if options.quick else REPEATS)
        for name, scene in timed.items()
    ]
    console = Console(width=100)
    for table in result_tables(errors, speeds):
        console.print(table)
    console.print(conditions_text())
    if options.json:
        write_json(
            options.json,
            {"errors": [asdict(item) for item in errors], "speeds": [asdict(item) for item in speeds]},
        )
    slow = [one.name for one in speeds if one.cpu_ms > LIMIT_MS.get(one.name, np.inf)]
    if slow:
        print(f"above its limit of CPU time: {', '.join(slow)}", file=sys.stderr)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
