"""Rendering: its time, and its own error against an independent reference.

Scenes of 640x480 and 331 markers: flat, seen through a distorting lens, pressed by a ball (a solved contact, seen from
the back), and that in the two halves of a virtual binocular. Blur 1 px and none, no noise. For its time only, a steep
dent that hides a part of itself.

The reference (``benchmarks.suites.scanlines``) shares no step with the renderer. The reference is inexact for sides
along its scan lines, so the patterns are rotated by 30 degrees, the flat one by 7.3. The error in grey levels is that
of a linear 16-bit image, in 8-bit units. The error in px is the shift of the gridlines' middles along their normals
with which the reference fits the image best. Times are those of sRGB images. One core.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
from benchmarks.suites.halves import two_cameras
from benchmarks.suites.scanlines import ImageWindow, measure_render_error
from cmpdesign.contact import Ball, Elastomer, Motion, solve
from cmpdesign.scene import Dent, Pinhole, Scene, composed, render, standard_layout, standard_scene

SIZE = (640, 480)
REPEATS, QUICK_REPEATS = 40, 5
LIMIT_MS = {"flat": 50.0, "pressed": 120.0, "steep, parts hidden": 120.0}  # of CPU time, the median
TURN_DEG = 30.0
UNDISTORTED = (0.0,) * 5
BARREL = (-0.2, 0.05, 0.001, -0.002, 0.0)


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
    halves = two_cameras(
        SIZE,
        (TURN_DEG, TURN_DEG),
        distance_mm=46,
        field_of_view_deg=30,
        tilt_deg=14,
        mirror=True,
        distortion=UNDISTORTED,
    )
    surface = contact.surface()
    return {
        "flat": flat,
        "distorted": replace(flat, camera=lens),
        "pressed": replace(flat, camera=back, surface=surface),
        "pressed, two views": replace(flat, camera=halves, surface=surface),
    }


def steep_scene(flat: Scene) -> Scene:
    """A dent viewed from the side: half a percent of the pattern turns away."""
    camera = Pinhole.looking(
        SIZE, distance_mm=36, field_of_view_deg=42, tilt_deg=50, roll_deg=TURN_DEG, back=True
    )
    return replace(flat, camera=camera, surface=composed(Dent(1.2, 2.0, (0.3, 0.4))))


def speed_row(name: str, scene: Scene, repeats: int) -> tuple[str, float, float, float]:
    """Times in ms with the blur and noise of the standard scene, after one picture that is not timed."""
    render(scene, size=SIZE)
    runs = [timed(partial(render, scene, size=SIZE)) for _ in range(repeats)]
    p50, p95 = np.percentile([one.clock_ms for one in runs], (50, 95))
    return name, float(p50), float(p95), float(np.median([one.cpu_ms for one in runs]))


def measure(quick: bool = False) -> Shown:
    """Fails if a picture takes longer than its limit.

    Args:
        quick: fewer repetitions and a smaller window.
    """
    window = ImageWindow(260, 180, 120, 120) if quick else ImageWindow(220, 140, 200, 200)
    scenes = make_scenes()
    # The first of the two views is the left half.
    windows = {name: window if "two" not in name else replace(window, x=80, width=120) for name in scenes}
    errors = [
        measure_render_error(name, scene, blur_px, windows[name], SIZE)
        for name, scene in scenes.items()
        for blur_px in (1.0, 0.0)
    ]
    columns = {"scene": TEXT, "blur px": "g", "grey RMS": ".4f", "largest grey": ".3f", "edge RMS px": ".6f"}
    columns |= {"largest edge px": ".6f", "gridlines": "d"}
    yield Table("the renderer's own error, linear pictures", columns, errors)
    timed = {**scenes, "steep, parts hidden": steep_scene(scenes["flat"])}
    rows = [speed_row(name, scene, QUICK_REPEATS if quick else REPEATS) for name, scene in timed.items()]
    title = "time of a picture, 640x480, 331 markers, blur 1 px, sRGB, noise 2/255"
    yield Table(title, {"scene": TEXT, "p50 ms": ".1f", "p95 ms": ".1f", "CPU p50 ms": ".1f"}, rows)
    slow = [row[0] for row in rows if row[3] > LIMIT_MS.get(row[0], np.inf)]
    if slow:
        yield f"above its limit of CPU time: {', '.join(slow)}"
    return Found(failed=bool(slow))


main = Experiment("rendering", measure)
main.run_as(__name__)
