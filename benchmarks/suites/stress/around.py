"""Conditions of what lies around the pattern, or beside it; and a little of everything."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.suites.stress.frames import PATTERNS, Frame, plain
from benchmarks.suites.stress.kinds import Kind, grouped
from cmpdesign.scene import Busy, Gradient, Paper, Picture, Plain, Press, Twist, colored_leds, render


def pattern_behind(frame: Frame, pitch_px: float) -> Frame:
    """Before a larger pattern without a white cell."""
    behind = plain("honeycomb", frame.scene.seed + 1, 24).seen(pitch_px=pitch_px)
    image = render(behind.inked(white=behind.scene.inks["black"]).scene, size=frame.size).image
    return frame.having(background=Picture(np.asarray(image, dtype=np.uint8)))


def beside(frame: Frame, pattern: str, pitch_px: float, **camera: Any) -> Frame:
    """A second pattern to the right of the first."""
    other = plain(pattern, frame.scene.seed + 1).seen(pitch_px=pitch_px, **camera)
    return replace(frame.seen(pitch_px=pitch_px), beside=other.scene)


def another(frame: Frame) -> str:
    return PATTERNS[PATTERNS.index(frame.layout.pattern) - 1]


def busy(frame: Frame, shapes: float, *, triangles: bool = False) -> Frame:
    return frame.seen(pitch_px=14).having(background=Busy(int(shapes), triangles))


def mixed(frame: Frame, step: float) -> Frame:
    """Everything a little: blur, noise, tilt, twist, colored light; and its step times."""
    frame = frame.blurred(1 + 0.5 * step).taken(noise=2 + 2 * step, jpeg_quality=round(98 - 8 * step))
    frame = frame.formed(Press(4, 0.4 * step), Twist(5, 6 * step, (1.0, -1.0)))
    light = colored_leds(3, 0.7, 0.6 - 0.1 * step)
    return frame.having(light=light, background=Busy()).seen(tilt_deg=10 * step, tilt_axis_deg=40)


AROUND = grouped(
    "around",
    Kind("plain background", "/255", (0, 90, 170, 255), lambda f, s: f.having(background=Plain((s, s, s)))),
    Kind(
        "red background", "/255", (100, 150, 200), lambda f, s: f.having(background=Plain((s, s / 4, s / 4)))
    ),
    Kind("shaded background", "deg", (30, 200), lambda f, s: f.having(background=Gradient(angle_deg=s))),
    Kind("paper background", "grain", (4, 12), lambda f, s: f.having(background=Paper(grain=s))),
    Kind("busy", "shapes", (50, 150, 400), busy),
    Kind("triangles around", "shapes", (50, 150, 400), lambda f, s: busy(f, s, triangles=True)),
    Kind("pattern behind", "px", (10, 14, 20, 30), lambda f, s: pattern_behind(f.seen(pitch_px=12), s)),
    Kind("two alike", "px", (12, 20), lambda f, s: beside(f, f.layout.pattern, s), False),
    Kind(
        "two, one mirrored", "px", (12, 20), lambda f, s: beside(f, f.layout.pattern, s, mirrored=True), False
    ),
    Kind("two, another pattern", "px", (12, 20), lambda f, s: beside(f, another(f), s), False),
    Kind("everything a little", "x", (0.5, 1, 1.5), mixed),
)
