"""Conditions of optics, sensor, inks and light."""

from __future__ import annotations

import numpy as np

from benchmarks.suites.stress.frames import RGB, PatternFrame
from benchmarks.suites.stress.kinds import ConditionKind, group_kinds
from cmpdesign.scene import Led, Paper, colored_leds
from cmpdesign.scene.standard import BLACK_RGB, INKS

STRONGEST_CONTRAST = 180.0  # of the standard red ink to black, 8-bit units


def mix_inks_toward(frame: PatternFrame, rgb: RGB, share: float) -> PatternFrame:
    """Every ink mixed with a color, for faded or yellowed prints."""
    return frame.with_inks(**{name: _mix_rgb(ink, rgb, share) for name, ink in INKS.items()})


def with_contrast(frame: PatternFrame, step: float) -> PatternFrame:
    """Every ink's contrast in proportion; ``step`` is the contrast of red in 8-bit units."""
    return mix_inks_toward(frame, BLACK_RGB, 1 - step / STRONGEST_CONTRAST)


def with_paper(frame: PatternFrame, warmth: float) -> PatternFrame:
    """Inks on warm paper; a warmth of 1 is kraft paper."""
    paper = _mix_rgb((245, 240, 230), (204, 158, 107), warmth)
    inks = {name: _as_rgb(np.array(ink) * paper / 255 + 12) for name, ink in INKS.items()}
    return frame.with_inks(**inks).with_parts(background=Paper(paper))


def with_hue_shift(frame: PatternFrame, share: float) -> PatternFrame:
    """Every ink shifted by a share towards the next color: orange for red, cyan for green, violet for blue."""
    red, green, blue = (200, 50 + 100 * share, 45), (40, 150, 60 + 100 * share), (45 + 80 * share, 60, 190)
    return frame.with_inks(red=red, green=green, blue=blue)


def gray_rgb(level: float) -> RGB:
    """Equal levels of all channels."""
    return level, level, level


def _mix_rgb(one: RGB, other: RGB, share: float) -> RGB:
    return _as_rgb((1 - share) * np.array(one) + share * np.array(other))


def _as_rgb(values: np.ndarray) -> RGB:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def with_leds(frame: PatternFrame, count: int, ambient: float, strength: float = 0.7) -> PatternFrame:
    """The light of colored LEDs."""
    return frame.with_parts(light=colored_leds(count, strength, ambient))


def with_red_led(frame: PatternFrame, strength: float) -> PatternFrame:
    """The light of one red LED."""
    return frame.with_light(rgb=gray_rgb(0.5), leds=(Led(30, (strength, 0, 0)),))


IMAGING_KINDS = group_kinds(
    "imaging",
    ConditionKind("plain", "", (0,), lambda f, s: f, repeats=4),
    ConditionKind("blur", "px", (1, 1.5, 2, 3, 4), lambda f, s: f.blurred(s)),
    ConditionKind("blur small edge", "px, pitch 10", (0.7, 1, 1.5, 2), lambda f, s: f.scaled(10).blurred(s)),
    ConditionKind("blur large edge", "px, pitch 40", (2, 4, 6, 8), lambda f, s: f.scaled(40).blurred(s)),
    ConditionKind("sharp", "px", (0, 0.3, 0.5), lambda f, s: f.blurred(s)),
    ConditionKind("noise", "/255", (2, 5, 10, 15, 20), lambda f, s: f.with_sensor(noise=s)),
    ConditionKind("noise and blur", "px, 10/255", (1, 2, 3), lambda f, s: f.with_sensor(noise=10).blurred(s)),
    ConditionKind("contrast", "/255", (160, 120, 80, 60, 40), with_contrast),
    ConditionKind(
        "contrast and noise",
        "/255, 5/255",
        (120, 80, 60, 40),
        lambda f, s: with_contrast(f.with_sensor(noise=5), s),
    ),
    ConditionKind("response", "exponent", (0.45, 0.7, 1.4, 2.2), lambda f, s: f.with_sensor(response=s)),
    ConditionKind("jpeg", "quality", (95, 80, 60, 40, 20), lambda f, s: f.with_sensor(jpeg_quality=int(s))),
    ConditionKind("saturation", "x", (1.3, 1.6, 2, 2.5), lambda f, s: f.with_light(rgb=gray_rgb(s))),
    ConditionKind("dark", "x", (0.7, 0.5, 0.3, 0.2), lambda f, s: f.with_light(rgb=gray_rgb(s))),
    ConditionKind("16 bits", "noise", (0.5, 5), lambda f, s: f.with_sensor(noise=s, bits=16)),
)

LIGHT_KINDS = group_kinds(
    "light",
    ConditionKind("two LEDs", "ambient", (0.6, 0.35, 0.15), lambda f, s: with_leds(f, 2, s)),
    ConditionKind("three LEDs", "ambient", (0.6, 0.35, 0.15), lambda f, s: with_leds(f, 3, s)),
    ConditionKind("LEDs' strength", "x", (0.4, 0.8, 1.2), lambda f, s: with_leds(f, 3, 0.35, s)),
    ConditionKind("one red LED", "x", (0.3, 0.6, 1), with_red_led),
    ConditionKind("gradient", "1", (0.3, 0.5, 0.7, 0.85), lambda f, s: f.with_light(gradient=(s, 0))),
    ConditionKind("diagonal gradient", "1", (0.2, 0.35, 0.45), lambda f, s: f.with_light(gradient=(s, -s))),
    ConditionKind("vignetting", "1", (0.3, 0.6, 0.9), lambda f, s: f.with_light(vignetting=s)),
    ConditionKind("warm light", "1", (0.2, 0.4, 0.6), lambda f, s: f.with_light(rgb=(1, 1 - s / 2, 1 - s))),
    ConditionKind("cold light", "1", (0.2, 0.4, 0.6), lambda f, s: f.with_light(rgb=(1 - s, 1 - s / 2, 1))),
    ConditionKind("green light", "1", (0.2, 0.4, 0.6), lambda f, s: f.with_light(rgb=(1 - s, 1, 1 - s))),
    ConditionKind(
        "faded print", "1", (0.1, 0.2, 0.35, 0.5), lambda f, s: mix_inks_toward(f, (235, 232, 225), s)
    ),
    ConditionKind(
        "yellowed print", "1", (0.1, 0.2, 0.35), lambda f, s: mix_inks_toward(f, (200, 170, 110), s)
    ),
    ConditionKind("warm paper", "1", (0, 0.5, 1), with_paper),
    ConditionKind("shifted hues", "1", (0.2, 0.4, 0.6), with_hue_shift),
    ConditionKind("grey white", "/255", (200, 150, 110, 80), lambda f, s: f.with_inks(white=gray_rgb(s))),
)
