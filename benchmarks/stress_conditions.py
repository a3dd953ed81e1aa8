"""The conditions of the stress suite: every kind in graded steps, each a function from the plain frame to its own.

A new condition is one line in a table here or in ``stress_damage``; the suite, its table, its plot and its test take it from there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.stress_damage import DAMAGE
from benchmarks.stress_empty import EMPTY
from benchmarks.stress_frames import Frame, Size, plain
from benchmarks.stress_kinds import Kind
from cmpdesign.layout import COLORS
from cmpdesign.scene import (
    Busy,
    Gradient,
    Led,
    Light,
    Optics,
    Paper,
    Picture,
    Plain,
    Press,
    Sensor,
    Shear,
    Twist,
    colored_leds,
    composed,
    render,
)
from cmpdesign.scene.standard import BLACK_RGB, INKS

PATTERNS = ("honeycomb", "round", "elliptical")
STRONGEST = 180.0  # the standard red ink's step to black


def contrast(frame: Frame, step: float) -> Frame:
    """Every ink's strength in proportion; ``step`` is red's, in 8-bit units."""
    black = np.array(BLACK_RGB)
    inks = {name: tuple(black + (np.array(ink) - black) * step / STRONGEST) for name, ink in INKS.items()}
    return frame.having(inks=inks)


def toward(frame: Frame, rgb: tuple[float, float, float], share: float) -> Frame:
    """Every ink mixed with a color: faded or yellowed."""
    inks = {name: tuple((1 - share) * np.array(ink) + share * np.array(rgb)) for name, ink in INKS.items()}
    return frame.having(inks=inks)


def on_paper(frame: Frame, warmth: float) -> Frame:
    """Inks printed on warm paper; 1 is kraft."""
    paper = 255 * (np.array([0.96, 0.94, 0.9]) * (1 - warmth) + np.array([0.8, 0.62, 0.42]) * warmth)
    inks = {name: tuple(np.array(ink) * paper / 255 + 12) for name, ink in INKS.items()}
    return frame.having(inks=inks, background=Paper(tuple(paper)))


def hue_shifted(frame: Frame, share: float) -> Frame:
    """Every ink takes a share of the next color: orange for red, cyan for green, violet for blue."""
    inks = {
        "red": (200, 50 + 100 * share, 45),
        "green": (40, 150, 60 + 100 * share),
        "blue": (45 + 80 * share, 60, 190),
    }
    return frame.having(inks={**INKS, **inks})


def cropped(frame: Frame, share: float, angle_deg: float = 0.0) -> Frame:
    """A share of the pattern's width lies beyond the image's rim; at 45 degrees beyond a corner."""
    width, height = frame.size
    reach = 0.5 * frame.pitch_px * min(frame.layout.size_mm)
    toward_rim = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    x = (width - 1) / 2 + np.sign(round(toward_rim[0], 6)) * (width / 2 - reach + 2 * reach * share)
    y = (height - 1) / 2 + np.sign(round(toward_rim[1], 6)) * (height / 2 - reach + 2 * reach * share)
    return frame.seen(centre_px=(float(x), float(y)))


def pattern_behind(frame: Frame, pitch_px: float) -> Frame:
    """Before a larger, paler pattern without a white cell."""
    behind = plain("honeycomb", frame.scene.seed + 1, 24)
    pale = {name: INKS["black"] if name == "white" else INKS[name] for name in COLORS}
    image = render(behind.seen(pitch_px=pitch_px).having(inks=pale).scene, size=frame.size).image
    return frame.having(background=Picture(image))


def beside(frame: Frame, pattern: str, **camera: object) -> Frame:
    """A second pattern to the right of the first."""
    other = plain(pattern, frame.scene.seed + 1)
    return replace(frame, beside=other.seen(**camera).scene)


def sized(frame: Frame, size: Size, pitch_px: float, layers: int) -> Frame:
    return plain(frame.layout.pattern, frame.scene.seed, layers, size).seen(pitch_px=pitch_px)


def filled(frame: Frame, size: Size, pitch_px: float, at_most: int = 45) -> Frame:
    """As many layers as fit."""
    return sized(frame, size, pitch_px, int(np.clip(min(size) / (2.15 * pitch_px) - 1, 2, at_most)))


SIZES = {
    0.02: (160, 120),
    0.08: (320, 240),
    1.2: (1280, 960),
    5.0: (2592, 1944),
    12.0: (4000, 3000),
    20.0: (5472, 3648),
}


def mixed(frame: Frame, step: float) -> Frame:
    """Everything a little: blur, noise, tilt, twist, colored light; and its step times."""
    frame = frame.having(
        optics=Optics(1 + 0.5 * step), sensor=Sensor(2 + 2 * step, jpeg_quality=round(98 - 8 * step))
    )
    frame = frame.having(surface=composed(Press(4, 0.4 * step), Twist(5, 6 * step, (1.0, -1.0))))
    frame = frame.having(light=colored_leds(3, 0.7, 0.6 - 0.1 * step)).seen(
        tilt_deg=10 * step, tilt_axis_deg=40
    )
    return frame.having(background=Busy())


def noisy(frame: Frame, noise: float) -> Frame:
    return frame.having(sensor=Sensor(noise))


def exposed(frame: Frame, gain: float) -> Frame:
    return frame.having(light=Light(rgb=(gain, gain, gain)))


def with_surface(frame: Frame, *deformations: Callable[..., np.ndarray]) -> Frame:
    return frame.having(surface=composed(*deformations))


IMAGING = (
    Kind("plain", "imaging", "", (0,), lambda f, s: f, repeats=4),
    Kind("blur", "imaging", "px", (1, 1.5, 2, 3, 4), lambda f, s: f.having(optics=Optics(s))),
    Kind(
        "blur small edge",
        "imaging",
        "px at 10",
        (0.7, 1, 1.5, 2),
        lambda f, s: f.scaled(10).having(optics=Optics(s)),
    ),
    Kind(
        "blur large edge",
        "imaging",
        "px at 40",
        (2, 4, 6, 8),
        lambda f, s: f.scaled(40).having(optics=Optics(s)),
    ),
    Kind("noise", "imaging", "/255", (2, 5, 10, 15, 20), noisy),
    Kind(
        "noise and blur",
        "imaging",
        "px, 10/255",
        (1, 2, 3),
        lambda f, s: noisy(f, 10).having(optics=Optics(s)),
    ),
    Kind("contrast", "imaging", "/255", (160, 120, 80, 60, 40), contrast),
    Kind(
        "contrast and noise", "imaging", "/255, 5", (120, 80, 60, 40), lambda f, s: noisy(contrast(f, s), 5)
    ),
    Kind("gamma", "imaging", "", (0.45, 0.7, 1.4, 2.2), lambda f, s: f.having(sensor=Sensor(2, gamma=s))),
    Kind(
        "jpeg",
        "imaging",
        "quality",
        (95, 80, 60, 40, 20),
        lambda f, s: f.having(sensor=Sensor(2, jpeg_quality=int(s))),
    ),
    Kind("saturation", "imaging", "x", (1.3, 1.6, 2, 2.5), exposed),
    Kind("dark", "imaging", "x", (0.7, 0.5, 0.3, 0.2), exposed),
    Kind("16 bits", "imaging", "noise", (0.5, 5), lambda f, s: f.having(sensor=Sensor(s, bits=16))),
    Kind("sharp", "imaging", "px", (0, 0.3, 0.5), lambda f, s: f.having(optics=Optics(s))),
)

LIGHT = (
    Kind(
        "two LEDs",
        "light",
        "ambient",
        (0.6, 0.35, 0.15),
        lambda f, s: f.having(light=colored_leds(2, 0.7, s)),
    ),
    Kind(
        "three LEDs",
        "light",
        "ambient",
        (0.6, 0.35, 0.15),
        lambda f, s: f.having(light=colored_leds(3, 0.7, s)),
    ),
    Kind(
        "LEDs' strength", "light", "x", (0.4, 0.8, 1.2), lambda f, s: f.having(light=colored_leds(3, s, 0.35))
    ),
    Kind(
        "one red LED",
        "light",
        "x",
        (0.3, 0.6, 1),
        lambda f, s: f.having(light=Light((0.5,) * 3, leds=(Led(30, (s, 0, 0)),))),
    ),
    Kind(
        "gradient", "light", "1", (0.3, 0.5, 0.7, 0.85), lambda f, s: f.having(light=Light(gradient=(s, 0)))
    ),
    Kind(
        "diagonal gradient",
        "light",
        "1",
        (0.2, 0.35, 0.45),
        lambda f, s: f.having(light=Light(gradient=(s, -s))),
    ),
    Kind("vignetting", "light", "1", (0.3, 0.6, 0.9), lambda f, s: f.having(light=Light(vignetting=s))),
    Kind(
        "warm light", "light", "1", (0.2, 0.4, 0.6), lambda f, s: f.having(light=Light((1, 1 - s / 2, 1 - s)))
    ),
    Kind(
        "cold light", "light", "1", (0.2, 0.4, 0.6), lambda f, s: f.having(light=Light((1 - s, 1 - s / 2, 1)))
    ),
    Kind("green light", "light", "1", (0.2, 0.4, 0.6), lambda f, s: f.having(light=Light((1 - s, 1, 1 - s)))),
    Kind("faded print", "light", "1", (0.1, 0.2, 0.35, 0.5), lambda f, s: toward(f, (235, 232, 225), s)),
    Kind("yellowed print", "light", "1", (0.1, 0.2, 0.35), lambda f, s: toward(f, (200, 170, 110), s)),
    Kind("warm paper", "light", "1", (0, 0.5, 1), on_paper),
    Kind("shifted hues", "light", "1", (0.2, 0.4, 0.6), hue_shifted),
    Kind(
        "grey white",
        "light",
        "/255",
        (200, 150, 110, 80),
        lambda f, s: f.having(inks={**INKS, "white": (s, s, s)}),
    ),
)

VIEW = (
    Kind("pitch", "view", "px", (6, 8, 10, 12, 16, 26, 40), lambda f, s: f.scaled(s)),
    Kind("rotation", "view", "deg", (0, 30, 45, 90, 123, 180, 270), lambda f, s: f.seen(rotation_deg=s)),
    Kind("tilt", "view", "deg", (15, 30, 45, 60), lambda f, s: f.seen(tilt_deg=s, tilt_axis_deg=20)),
    Kind("tilt's axis", "view", "deg", (0, 60, 120), lambda f, s: f.seen(tilt_deg=45, tilt_axis_deg=s)),
    Kind("near camera", "view", "focal px", (900, 600, 450), lambda f, s: f.seen(tilt_deg=35, focal_px=s)),
    Kind("mirrored", "view", "tilt deg", (0, 20, 45), lambda f, s: f.seen(tilt_deg=s, mirrored=True)),
    Kind("cropped side", "view", "1", (0.1, 0.25, 0.4, 0.5), cropped),
    Kind("cropped corner", "view", "1", (0.1, 0.25, 0.4), lambda f, s: cropped(f, s, 45)),
    Kind("overflowing", "view", "px", (26, 40, 60), lambda f, s: f.seen(pitch_px=s)),
    Kind(
        "megapixels",
        "view",
        "",
        (0.08, 1.2, 5, 12, 20),
        lambda f, s: sized(f, SIZES[s], SIZES[s][1] / 24, 11),
    ),
    Kind("small cells", "view", "MP, 12 px", (0.02, 0.08, 1.2), lambda f, s: filled(f, SIZES[s], 12)),
    Kind("medium cells", "view", "MP, 40 px", (1.2, 5, 20), lambda f, s: filled(f, SIZES[s], 40)),
    Kind("large cells", "view", "MP, 200 px", (1.2, 5, 20), lambda f, s: filled(f, SIZES[s], 200)),
    Kind("tiny image", "view", "px", (6, 8, 12, 20), lambda f, s: filled(f, SIZES[0.02], s)),
    Kind("layers", "view", "", (2, 4, 7), lambda f, s: sized(f, f.size, 20, int(s))),
)

SURFACE = (
    Kind("bulge", "surface", "pitch", (0.5, 1, 1.5, 2, 2.5), lambda f, s: with_surface(f, Press(4, s))),
    Kind("pinch", "surface", "pitch", (0.5, 1, 1.5, 2), lambda f, s: with_surface(f, Press(4, -s))),
    Kind("bulge aside", "surface", "pitch", (0.5, 1, 1.5), lambda f, s: with_surface(f, Press(3, s, (5, -2)))),
    Kind("bulge on the white cell", "surface", "pitch", (0.5, 1, 1.3), lambda f, s: with_surface(f, Press(1.5, s, (0, 0.5)))),
    Kind("two presses", "surface", "pitch", (0.4, 0.8, 1.2), lambda f, s: with_surface(f, Press(2.5, s, (4, 2)), Press(2.5, s, (-3, -4)))),
    Kind("twist", "surface", "deg", (6, 12, 18, 24, 30), lambda f, s: with_surface(f, Twist(5, s))),
    Kind("twist aside", "surface", "deg", (10, 20, 30), lambda f, s: with_surface(f, Twist(3.5, -s, (-4, 3)))),
    Kind("shear", "surface", "pitch", (0.25, 0.5, 1, 1.5), lambda f, s: with_surface(f, Shear(4, (s, 0)))),
    Kind("shear across", "surface", "pitch", (0.5, 1, 1.5), lambda f, s: with_surface(f, Shear(3, (-0.5 * s, 0.87 * s), (2, 1)))),
    Kind("contact", "surface", "x", (0.5, 1, 1.5), lambda f, s: with_surface(f, Press(4, 0.9 * s), Twist(4, 12 * s), Shear(4, (0.5 * s, 0.3 * s)))),
    Kind("contact, tilted", "surface", "x", (0.5, 1, 1.5), lambda f, s: with_surface(f, Press(4, 0.7 * s), Shear(4, (0.6 * s, 0))).seen(tilt_deg=30)),
)  # fmt: skip

AROUND = (
    Kind("plain background", "around", "/255", (0, 90, 170, 255), lambda f, s: f.having(background=Plain((s, s, s)))),
    Kind("red background", "around", "/255", (100, 150, 200), lambda f, s: f.having(background=Plain((s, s / 4, s / 4)))),
    Kind("shaded background", "around", "deg", (30, 200), lambda f, s: f.having(background=Gradient(angle_deg=s))),
    Kind("paper background", "around", "grain", (4, 12), lambda f, s: f.having(background=Paper(grain=s))),
    Kind("busy", "around", "shapes", (50, 150, 400), lambda f, s: f.scaled(14).seen(pitch_px=10).having(background=Busy(int(s)))),
    Kind("triangles around", "around", "shapes", (50, 150, 400), lambda f, s: f.seen(pitch_px=14).having(background=Busy(int(s), triangles=True))),
    Kind("pattern behind", "around", "px", (10, 14, 20, 30), lambda f, s: pattern_behind(f.seen(pitch_px=12), s)),
    Kind("two alike", "around", "px", (12, 20), lambda f, s: beside(f, f.layout.pattern, pitch_px=s), promised=False),
    Kind("two, one mirrored", "around", "px", (12, 20), lambda f, s: beside(f, f.layout.pattern, pitch_px=s, mirrored=True), promised=False),
    Kind("two, another pattern", "around", "px", (12, 20), lambda f, s: beside(f, PATTERNS[PATTERNS.index(f.layout.pattern) - 1], pitch_px=s), promised=False),
    Kind("everything a little", "around", "x", (0.5, 1, 1.5), mixed),
)  # fmt: skip

KINDS: tuple[Kind, ...] = (*IMAGING, *LIGHT, *VIEW, *SURFACE, *DAMAGE, *AROUND, *EMPTY)
