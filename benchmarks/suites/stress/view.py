"""Conditions of the camera's place, the image's size and the surface's state."""

from __future__ import annotations

import numpy as np

from benchmarks.suites.stress.frames import Frame, Size, plain
from benchmarks.suites.stress.kinds import Kind, grouped
from cmpdesign.scene import Press, Shear, Twist

SIZES: dict[float, Size] = {
    0.02: (160, 120),
    0.08: (320, 240),
    1.2: (1280, 960),
    5.0: (2592, 1944),
    12.0: (4000, 3000),
    20.0: (5472, 3648),
}
MOST_LAYERS = 45


def cropped(frame: Frame, share: float, angle_deg: float = 0.0) -> Frame:
    """A share of the pattern's width lies beyond the image's rim; at 45 degrees beyond a corner."""
    width, height = frame.size
    reach = 0.5 * frame.pitch_px * min(frame.layout.size_mm)
    toward_rim = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    x = (width - 1) / 2 + np.sign(round(toward_rim[0], 6)) * (width / 2 - reach + 2 * reach * share)
    y = (height - 1) / 2 + np.sign(round(toward_rim[1], 6)) * (height / 2 - reach + 2 * reach * share)
    return frame.seen(centre_px=(float(x), float(y)))


def sized(frame: Frame, size: Size, pitch_px: float, layers: int) -> Frame:
    """The plain frame of another size of image and pattern."""
    return plain(frame.layout.pattern, frame.scene.seed, layers, size).seen(pitch_px=pitch_px)


def filled(frame: Frame, size: Size, pitch_px: float) -> Frame:
    """As many layers as fit."""
    fitting = int(min(size) / (2.15 * pitch_px) - 1)
    return sized(frame, size, pitch_px, min(max(fitting, 2), MOST_LAYERS))


def contact(frame: Frame, step: float) -> Frame:
    """A press that also turns and drags the skin."""
    return frame.formed(Press(4, 0.9 * step), Twist(4, 12 * step), Shear(4, (0.5 * step, 0.3 * step)))


def contact_tilted(frame: Frame, step: float) -> Frame:
    return frame.formed(Press(4, 0.7 * step), Shear(4, (0.6 * step, 0))).seen(tilt_deg=30)


def two_presses(frame: Frame, depth_mm: float) -> Frame:
    return frame.formed(Press(2.5, depth_mm, (4, 2)), Press(2.5, depth_mm, (-3, -4)))


VIEW = grouped(
    "view",
    Kind("pitch", "px", (6, 8, 10, 12, 16, 26, 40), lambda f, s: f.scaled(s)),
    Kind("rotation", "deg", (0, 30, 45, 90, 123, 180, 270), lambda f, s: f.seen(rotation_deg=s)),
    Kind("tilt", "deg", (15, 30, 45, 60), lambda f, s: f.seen(tilt_deg=s, tilt_axis_deg=20)),
    Kind("tilt's axis", "deg", (0, 60, 120), lambda f, s: f.seen(tilt_deg=45, tilt_axis_deg=s)),
    Kind("near camera", "focal px", (900, 600, 450), lambda f, s: f.seen(tilt_deg=35, focal_px=s)),
    Kind("mirrored", "tilt deg", (0, 20, 45), lambda f, s: f.seen(tilt_deg=s, mirrored=True)),
    Kind("cropped side", "1", (0.1, 0.25, 0.4, 0.5), cropped),
    Kind("cropped corner", "1", (0.1, 0.25, 0.4), lambda f, s: cropped(f, s, 45)),
    Kind("overflowing", "px", (26, 40, 60), lambda f, s: f.seen(pitch_px=s)),
    Kind("megapixels", "", (0.08, 1.2, 5, 12, 20), lambda f, s: sized(f, SIZES[s], SIZES[s][1] / 24, 11)),
    Kind("small cells", "MP, 12 px", (0.02, 0.08, 1.2, 5), lambda f, s: filled(f, SIZES[s], 12)),
    Kind("medium cells", "MP, 40 px", (1.2, 5, 20), lambda f, s: filled(f, SIZES[s], 40)),
    Kind("large cells", "MP, 200 px", (1.2, 5, 20), lambda f, s: filled(f, SIZES[s], 200)),
    Kind("tiny image", "px, 160x120", (6, 8, 12, 20), lambda f, s: filled(f, SIZES[0.02], s)),
    Kind("layers", "", (2, 4, 7), lambda f, s: sized(f, f.size, 20, int(s))),
)

SURFACE = grouped(
    "surface",
    Kind("bulge", "pitch", (0.5, 1, 1.5, 2, 2.5), lambda f, s: f.formed(Press(4, s))),
    Kind("pinch", "pitch", (0.5, 1, 1.5, 2), lambda f, s: f.formed(Press(4, -s))),
    Kind("bulge aside", "pitch", (0.5, 1, 1.5), lambda f, s: f.formed(Press(3, s, (5, -2)))),
    Kind("bulge on the white cell", "pitch", (0.5, 1, 1.3), lambda f, s: f.formed(Press(1.5, s, (0, 0.5)))),
    Kind("two presses", "pitch", (0.4, 0.8, 1.2), two_presses),
    Kind("twist", "deg", (6, 12, 18, 24, 30), lambda f, s: f.formed(Twist(5, s))),
    Kind("twist aside", "deg", (10, 20, 30), lambda f, s: f.formed(Twist(3.5, -s, (-4, 3)))),
    Kind("shear", "pitch", (0.25, 0.5, 1, 1.5), lambda f, s: f.formed(Shear(4, (s, 0)))),
    Kind("shear across", "pitch", (0.5, 1, 1.5), lambda f, s: f.formed(Shear(3, (-s / 2, 0.87 * s), (2, 1)))),
    Kind("contact", "x", (0.5, 1, 1.5), contact),
    Kind("contact, tilted", "x", (0.5, 1, 1.5), contact_tilted),
)
