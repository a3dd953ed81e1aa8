"""Conditions of optics, sensor, inks and light."""

from __future__ import annotations

import numpy as np

from benchmarks.suites.stress.frames import RGB, Frame
from benchmarks.suites.stress.kinds import Kind, grouped
from cmpdesign.scene import Led, Paper, colored_leds
from cmpdesign.scene.standard import BLACK_RGB, INKS

STRONGEST = 180.0  # the standard red ink's step to black


def toward(frame: Frame, rgb: RGB, share: float) -> Frame:
    """Every ink mixed with a color: faded or yellowed."""
    return frame.inked(**{name: _mixed(ink, rgb, share) for name, ink in INKS.items()})


def contrast(frame: Frame, step: float) -> Frame:
    """Every ink's strength in proportion; ``step`` is red's, in 8-bit units."""
    return toward(frame, BLACK_RGB, 1 - step / STRONGEST)


def on_paper(frame: Frame, warmth: float) -> Frame:
    """Inks printed on warm paper; 1 is kraft."""
    paper = _mixed((245, 240, 230), (204, 158, 107), warmth)
    inks = {name: _rgb(np.array(ink) * paper / 255 + 12) for name, ink in INKS.items()}
    return frame.inked(**inks).having(background=Paper(paper))


def hue_shifted(frame: Frame, share: float) -> Frame:
    """Every ink takes a share of the next color: orange for red, cyan for green, violet for blue."""
    red, green, blue = (200, 50 + 100 * share, 45), (40, 150, 60 + 100 * share), (45 + 80 * share, 60, 190)
    return frame.inked(red=red, green=green, blue=blue)


def grey(level: float) -> RGB:
    return level, level, level


def _mixed(one: RGB, other: RGB, share: float) -> RGB:
    return _rgb((1 - share) * np.array(one) + share * np.array(other))


def _rgb(values: np.ndarray) -> RGB:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def leds(frame: Frame, count: int, ambient: float, strength: float = 0.7) -> Frame:
    return frame.having(light=colored_leds(count, strength, ambient))


def red_led(frame: Frame, strength: float) -> Frame:
    return frame.lit(rgb=grey(0.5), leds=(Led(30, (strength, 0, 0)),))


IMAGING = grouped(
    "imaging",
    Kind("plain", "", (0,), lambda f, s: f, repeats=4),
    Kind("blur", "px", (1, 1.5, 2, 3, 4), lambda f, s: f.blurred(s)),
    Kind("blur small edge", "px, pitch 10", (0.7, 1, 1.5, 2), lambda f, s: f.scaled(10).blurred(s)),
    Kind("blur large edge", "px, pitch 40", (2, 4, 6, 8), lambda f, s: f.scaled(40).blurred(s)),
    Kind("sharp", "px", (0, 0.3, 0.5), lambda f, s: f.blurred(s)),
    Kind("noise", "/255", (2, 5, 10, 15, 20), lambda f, s: f.taken(noise=s)),
    Kind("noise and blur", "px, 10/255", (1, 2, 3), lambda f, s: f.taken(noise=10).blurred(s)),
    Kind("contrast", "/255", (160, 120, 80, 60, 40), contrast),
    Kind("contrast and noise", "/255, 5/255", (120, 80, 60, 40), lambda f, s: contrast(f.taken(noise=5), s)),
    Kind("gamma", "", (0.45, 0.7, 1.4, 2.2), lambda f, s: f.taken(gamma=s)),
    Kind("jpeg", "quality", (95, 80, 60, 40, 20), lambda f, s: f.taken(jpeg_quality=int(s))),
    Kind("saturation", "x", (1.3, 1.6, 2, 2.5), lambda f, s: f.lit(rgb=grey(s))),
    Kind("dark", "x", (0.7, 0.5, 0.3, 0.2), lambda f, s: f.lit(rgb=grey(s))),
    Kind("16 bits", "noise", (0.5, 5), lambda f, s: f.taken(noise=s, bits=16)),
)

LIGHT = grouped(
    "light",
    Kind("two LEDs", "ambient", (0.6, 0.35, 0.15), lambda f, s: leds(f, 2, s)),
    Kind("three LEDs", "ambient", (0.6, 0.35, 0.15), lambda f, s: leds(f, 3, s)),
    Kind("LEDs' strength", "x", (0.4, 0.8, 1.2), lambda f, s: leds(f, 3, 0.35, s)),
    Kind("one red LED", "x", (0.3, 0.6, 1), red_led),
    Kind("gradient", "1", (0.3, 0.5, 0.7, 0.85), lambda f, s: f.lit(gradient=(s, 0))),
    Kind("diagonal gradient", "1", (0.2, 0.35, 0.45), lambda f, s: f.lit(gradient=(s, -s))),
    Kind("vignetting", "1", (0.3, 0.6, 0.9), lambda f, s: f.lit(vignetting=s)),
    Kind("warm light", "1", (0.2, 0.4, 0.6), lambda f, s: f.lit(rgb=(1, 1 - s / 2, 1 - s))),
    Kind("cold light", "1", (0.2, 0.4, 0.6), lambda f, s: f.lit(rgb=(1 - s, 1 - s / 2, 1))),
    Kind("green light", "1", (0.2, 0.4, 0.6), lambda f, s: f.lit(rgb=(1 - s, 1, 1 - s))),
    Kind("faded print", "1", (0.1, 0.2, 0.35, 0.5), lambda f, s: toward(f, (235, 232, 225), s)),
    Kind("yellowed print", "1", (0.1, 0.2, 0.35), lambda f, s: toward(f, (200, 170, 110), s)),
    Kind("warm paper", "1", (0, 0.5, 1), on_paper),
    Kind("shifted hues", "1", (0.2, 0.4, 0.6), hue_shifted),
    Kind("grey white", "/255", (200, 150, 110, 80), lambda f, s: f.inked(white=grey(s))),
)
