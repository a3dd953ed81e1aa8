"""Conditions of the background and of a second pattern, and combined conditions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.suites.stress.frames import PATTERNS, PatternFrame, plain_frame
from benchmarks.suites.stress.kinds import ConditionKind, group_kinds
from cmpdesign.scene import Busy, Gradient, Paper, Picture, Plain, Press, Twist, colored_leds, render


def pattern_behind(frame: PatternFrame, pitch_px: float) -> PatternFrame:
    """A larger pattern without a white cell as background."""
    background = plain_frame("honeycomb", frame.scene.seed + 1, 24).with_camera(pitch_px=pitch_px)
    image = render(background.with_inks(white=background.scene.inks["black"]).scene, size=frame.size).image
    return frame.with_parts(background=Picture(np.asarray(image, dtype=np.uint8)))


def second_pattern_beside(frame: PatternFrame, pattern: str, pitch_px: float, **camera: Any) -> PatternFrame:
    """A second pattern to the right of the first."""
    other = plain_frame(pattern, frame.scene.seed + 1).with_camera(pitch_px=pitch_px, **camera)
    return replace(frame.with_camera(pitch_px=pitch_px), second=other.scene)


def other_pattern_name(frame: PatternFrame) -> str:
    """The name of another pattern than the frame's."""
    return PATTERNS[PATTERNS.index(frame.layout.pattern) - 1]


def busy_background(frame: PatternFrame, shapes: float, *, triangles: bool = False) -> PatternFrame:
    """A cluttered background."""
    return frame.with_camera(pitch_px=14).with_parts(background=Busy(int(shapes), triangles))


def mixed_conditions(frame: PatternFrame, step: float) -> PatternFrame:
    """Blur, noise, compression, tilt, deformation, colored light and clutter, in proportion to the step."""
    frame = frame.blurred(1 + 0.5 * step).with_sensor(noise=2 + 2 * step, jpeg_quality=round(98 - 8 * step))
    frame = frame.with_surface(Press(4, 0.4 * step), Twist(5, 6 * step, (1.0, -1.0)))
    light = colored_leds(3, 0.7, 0.6 - 0.1 * step)
    return frame.with_parts(light=light, background=Busy()).with_camera(tilt_deg=10 * step, tilt_axis_deg=40)


AROUND_KINDS = group_kinds(
    "around",
    ConditionKind(
        "plain background", "/255", (0, 90, 170, 255), lambda f, s: f.with_parts(background=Plain((s, s, s)))
    ),
    ConditionKind(
        "red background",
        "/255",
        (100, 150, 200),
        lambda f, s: f.with_parts(background=Plain((s, s / 4, s / 4))),
    ),
    ConditionKind(
        "shaded background", "deg", (30, 200), lambda f, s: f.with_parts(background=Gradient(angle_deg=s))
    ),
    ConditionKind("paper background", "grain", (4, 12), lambda f, s: f.with_parts(background=Paper(grain=s))),
    ConditionKind("busy", "shapes", (50, 150, 400), busy_background),
    ConditionKind(
        "triangles around", "shapes", (50, 150, 400), lambda f, s: busy_background(f, s, triangles=True)
    ),
    ConditionKind(
        "pattern behind", "px", (10, 14, 20, 30), lambda f, s: pattern_behind(f.with_camera(pitch_px=12), s)
    ),
    ConditionKind(
        "two alike", "px", (12, 20), lambda f, s: second_pattern_beside(f, f.layout.pattern, s), False
    ),
    ConditionKind(
        "two, one mirrored",
        "px",
        (12, 20),
        lambda f, s: second_pattern_beside(f, f.layout.pattern, s, mirrored=True),
        False,
    ),
    ConditionKind(
        "two, another pattern",
        "px",
        (12, 20),
        lambda f, s: second_pattern_beside(f, other_pattern_name(f), s),
        False,
    ),
    ConditionKind("everything a little", "x", (0.5, 1, 1.5), mixed_conditions),
)
