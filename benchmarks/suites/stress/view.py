"""Conditions of the camera's pose, the image's size and the surface's state."""

from __future__ import annotations

import numpy as np

from benchmarks.suites.stress.frames import PatternFrame, Size, plain_frame
from benchmarks.suites.stress.kinds import ConditionKind, group_kinds
from cmpdesign.scene import Press, Shear, Twist

SIZES: dict[float, Size] = {
    0.02: (160, 120),
    0.08: (320, 240),
    1.2: (1280, 960),
    5.0: (2592, 1944),
    12.0: (4000, 3000),
    20.0: (5472, 3648),
}
MAX_LAYERS = 45


def crop_frame(frame: PatternFrame, share: float, angle_deg: float = 0.0) -> PatternFrame:
    """A share of the pattern's width lies outside the image; at 45 degrees outside a corner."""
    width, height = frame.size
    reach = 0.5 * frame.pitch_px * min(frame.layout.size_mm)
    toward_rim = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    x = (width - 1) / 2 + np.sign(round(toward_rim[0], 6)) * (width / 2 - reach + 2 * reach * share)
    y = (height - 1) / 2 + np.sign(round(toward_rim[1], 6)) * (height / 2 - reach + 2 * reach * share)
    return frame.with_camera(centre_px=(float(x), float(y)))


def resize_frame(frame: PatternFrame, size: Size, pitch_px: float, layers: int) -> PatternFrame:
    """The plain frame with other sizes of image and pattern."""
    return plain_frame(frame.layout.pattern, frame.scene.seed, layers, size).with_camera(pitch_px=pitch_px)


def frame_filled_with_layers(frame: PatternFrame, size: Size, pitch_px: float) -> PatternFrame:
    """The frame with as many layers as fit the image."""
    fitting = int(min(size) / (2.15 * pitch_px) - 1)
    return resize_frame(frame, size, pitch_px, min(max(fitting, 2), MAX_LAYERS))


def with_contact(frame: PatternFrame, step: float) -> PatternFrame:
    """A press with twist and shear."""
    return frame.with_surface(Press(4, 0.9 * step), Twist(4, 12 * step), Shear(4, (0.5 * step, 0.3 * step)))


def with_tilted_contact(frame: PatternFrame, step: float) -> PatternFrame:
    """A press with shear under a tilted camera."""
    return frame.with_surface(Press(4, 0.7 * step), Shear(4, (0.6 * step, 0))).with_camera(tilt_deg=30)


def with_two_presses(frame: PatternFrame, depth_mm: float) -> PatternFrame:
    """Two presses side by side."""
    return frame.with_surface(Press(2.5, depth_mm, (4, 2)), Press(2.5, depth_mm, (-3, -4)))


VIEW_KINDS = group_kinds(
    "view",
    ConditionKind("pitch", "px", (6, 8, 10, 12, 16, 26, 40), lambda f, s: f.scaled(s)),
    ConditionKind(
        "rotation", "deg", (0, 30, 45, 90, 123, 180, 270), lambda f, s: f.with_camera(rotation_deg=s)
    ),
    ConditionKind("tilt", "deg", (15, 30, 45, 60), lambda f, s: f.with_camera(tilt_deg=s, tilt_axis_deg=20)),
    ConditionKind(
        "tilt's axis", "deg", (0, 60, 120), lambda f, s: f.with_camera(tilt_deg=45, tilt_axis_deg=s)
    ),
    ConditionKind(
        "near camera", "focal px", (900, 600, 450), lambda f, s: f.with_camera(tilt_deg=35, focal_px=s)
    ),
    ConditionKind("mirrored", "tilt deg", (0, 20, 45), lambda f, s: f.with_camera(tilt_deg=s, mirrored=True)),
    ConditionKind("cropped side", "1", (0.1, 0.25, 0.4, 0.5), crop_frame),
    ConditionKind("cropped corner", "1", (0.1, 0.25, 0.4), lambda f, s: crop_frame(f, s, 45)),
    ConditionKind("overflowing", "px", (26, 40, 60), lambda f, s: f.with_camera(pitch_px=s)),
    ConditionKind(
        "megapixels", "", (0.08, 1.2, 5, 12, 20), lambda f, s: resize_frame(f, SIZES[s], SIZES[s][1] / 24, 11)
    ),
    ConditionKind(
        "small cells",
        "MP, 12 px",
        (0.02, 0.08, 1.2, 5),
        lambda f, s: frame_filled_with_layers(f, SIZES[s], 12),
    ),
    ConditionKind(
        "medium cells", "MP, 40 px", (1.2, 5, 20), lambda f, s: frame_filled_with_layers(f, SIZES[s], 40)
    ),
    ConditionKind(
        "large cells", "MP, 200 px", (1.2, 5, 20), lambda f, s: frame_filled_with_layers(f, SIZES[s], 200)
    ),
    ConditionKind(
        "tiny image", "px, 160x120", (6, 8, 12, 20), lambda f, s: frame_filled_with_layers(f, SIZES[0.02], s)
    ),
    ConditionKind("layers", "", (2, 4, 7), lambda f, s: resize_frame(f, f.size, 20, int(s))),
)

SURFACE_KINDS = group_kinds(
    "surface",
    ConditionKind("bulge", "pitch", (0.5, 1, 1.5, 2, 2.5), lambda f, s: f.with_surface(Press(4, s))),
    ConditionKind("pinch", "pitch", (0.5, 1, 1.5, 2), lambda f, s: f.with_surface(Press(4, -s))),
    ConditionKind("bulge aside", "pitch", (0.5, 1, 1.5), lambda f, s: f.with_surface(Press(3, s, (5, -2)))),
    ConditionKind(
        "bulge on the white cell",
        "pitch",
        (0.5, 1, 1.3),
        lambda f, s: f.with_surface(Press(1.5, s, (0, 0.5))),
    ),
    ConditionKind("two presses", "pitch", (0.4, 0.8, 1.2), with_two_presses),
    ConditionKind("twist", "deg", (6, 12, 18, 24, 30), lambda f, s: f.with_surface(Twist(5, s))),
    ConditionKind("twist aside", "deg", (10, 20, 30), lambda f, s: f.with_surface(Twist(3.5, -s, (-4, 3)))),
    ConditionKind("shear", "pitch", (0.25, 0.5, 1, 1.5), lambda f, s: f.with_surface(Shear(4, (s, 0)))),
    ConditionKind(
        "shear across",
        "pitch",
        (0.5, 1, 1.5),
        lambda f, s: f.with_surface(Shear(3, (-s / 2, 0.87 * s), (2, 1))),
    ),
    ConditionKind("contact", "x", (0.5, 1, 1.5), with_contact),
    ConditionKind("contact, tilted", "x", (0.5, 1, 1.5), with_tilted_contact),
)
