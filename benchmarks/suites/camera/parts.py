"""The parameters of a picture, one record for each part of the chain from ink to file.

The defaults are neutral: a flat print with the standard inks under white light, a sharp lens, a sensor with three
channels in every pixel and little noise, the sRGB encoding, no compression. Light is linear; 1 is the light that the
value 255 stands for at an exposure of 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from cmpdesign.scene import Light

RGB = tuple[float, float, float]
SurroundKind = Literal["plain", "wood", "skin"]
Demosaicing = Literal["edge-aware", "bilinear"]
PATTERNS = ("honeycomb", "round", "elliptical")
SIZE_PX = (640, 480)  # width, height of every picture
FULL_WELL = 8000.0  # electrons of the largest light: with 6 electrons of read noise about 2/255 of the encoded picture
READ_NOISE = 6.0  # electrons


@dataclass(frozen=True)
class Pose:
    """The pattern and its place before the camera.

    Attributes:
        pattern: the name of a registered triangular pattern.
        layers: the number of its layers.
        code: its code; 0 is the plain pattern.
        pitch_px: edge length at the pattern's middle, without foreshortening.
        roll_deg, tilt_deg, tilt_axis_deg: see ``cmpdesign.scene.Camera``.
        centre_px: position of the pattern's middle, before distortion.
    """

    pattern: str = "honeycomb"
    layers: int = 9
    code: int = 0
    pitch_px: float = 20.0
    roll_deg: float = 7.3
    tilt_deg: float = 0.0
    tilt_axis_deg: float = 0.0
    centre_px: tuple[float, float] = (319.5, 239.5)


def _reflectance(rgb: tuple[int, int, int]) -> RGB:
    """Linear light of an sRGB color of 8 bits."""
    red, green, blue = (((value / 255 + 0.055) / 1.055) ** 2.4 for value in rgb)
    return red, green, blue


@dataclass(frozen=True)
class Inks:
    """Linear reflectances (R, G, B), 0 to 1. The defaults are those of the standard scene."""

    red: RGB = (0.5776, 0.0319, 0.0262)
    green: RGB = (0.0212, 0.3050, 0.0452)
    blue: RGB = (0.0262, 0.0452, 0.5149)
    white: RGB = (0.9131, 0.9131, 0.9131)
    black: RGB = (0.0070, 0.0070, 0.0070)


# Reflectances of inks as they are made, each of sRGB colors: pigmented silicone, pastel, a dark green, a navy and an
# orange among printed inks, fluorescent ones. The order is that of ``Inks``.
PIGMENTS = tuple(
    Inks(*(_reflectance(rgb) for rgb in inks))
    for inks in (
        ((170, 60, 55), (70, 120, 80), (60, 80, 140), (205, 200, 190), (45, 42, 40)),
        ((235, 150, 150), (150, 220, 160), (150, 170, 235), (240, 240, 235), (60, 60, 60)),
        ((200, 50, 45), (20, 80, 35), (45, 60, 190), (230, 230, 230), (20, 20, 20)),
        ((200, 50, 45), (40, 150, 60), (25, 30, 90), (230, 230, 230), (18, 18, 18)),
        ((225, 100, 30), (40, 150, 60), (45, 60, 190), (235, 235, 230), (20, 20, 20)),
        ((255, 40, 90), (60, 255, 70), (60, 90, 255), (250, 250, 250), (25, 25, 25)),
    )
)


@dataclass(frozen=True)
class Surround:
    """The surround of the pattern: kind, linear reflectance, and strength of the texture, 0 to 1."""

    kind: SurroundKind = "plain"
    rgb: RGB = (0.0070, 0.0070, 0.0070)
    texture: float = 0.0


@dataclass(frozen=True)
class Pad:
    """The differences of a pad from its design.

    Attributes:
        color_shift: the longest shift of a color's cells, as a share of the pitch. Each color has a different shift;
            the mean shift of red, green and blue is zero.
        corner_scatter_px: every corner of every colored cell moves independently by up to this distance, in px at the
            pattern's middle.
        rounding: radius of the corners as a share of the pitch.
        bleed: every side of a colored cell moves outward by up to this share of the pitch.
    """

    color_shift: float = 0.0
    corner_scatter_px: float = 0.0
    rounding: float = 0.0
    bleed: float = 0.0


@dataclass(frozen=True)
class Lens:
    """The lens, and the motion during the exposure.

    Attributes:
        blur_px: sigma of the sharp lens.
        defocus_px: radius of the disc of defocus.
        aberration_px: red is displaced outward, blue inward by this distance in the image's corners.
        bloom: share of the light that is scattered far.
        vignetting: share of the light that the image's corners lose.
        distortion: radial displacement in the image's corners as a share of their distance; negative: barrel.
        motion_px, motion_deg: length and direction of a uniform motion during the exposure.
    """

    blur_px: float = 0.8
    defocus_px: float = 0.0
    aberration_px: float = 0.0
    bloom: float = 0.0
    vignetting: float = 0.0
    distortion: float = 0.0
    motion_px: float = 0.0
    motion_deg: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """The sensor.

    Attributes:
        exposure: factor of the light; at 1 a perfect white under the mean light just fits.
        electrons: of the largest light.
        read_noise: electrons.
        lifted_black: light that is added to every pixel, as a share of the largest light.
        demosaicing: None: every pixel has all channels; else a Bayer mosaic.
        phase: 0 to 3, the place of red in the mosaic, row by row.
    """

    exposure: float = 1.0
    electrons: float = FULL_WELL
    read_noise: float = READ_NOISE
    lifted_black: float = 0.0
    demosaicing: Demosaicing | None = None
    phase: int = 0


@dataclass(frozen=True)
class Development:
    """From the sensor's light to the file.

    Attributes:
        balance: share of the lamps' mean color that the white balance removes.
        balance_error: (R, G, B) logarithms of further gains.
        sharpening: strength of the unsharp mask.
        tone_mapping: exponent of the local tone mapping, 0 to 1.
        s_curve: strength of the S-shaped tone curve, 0 to 1.
        jpeg_quality: 1 to 100; None: no compression.
        jpeg_420: colors at half the resolution.
    """

    balance: float = 1.0
    balance_error: RGB = (0.0, 0.0, 0.0)
    sharpening: float = 0.0
    tone_mapping: float = 0.0
    s_curve: float = 0.0
    jpeg_quality: int | None = None
    jpeg_420: bool = False


@dataclass(frozen=True)
class Chain:
    """All parts of one picture, in the order of the light. ``seed`` is that of all random fields of the parts."""

    pose: Pose = field(default_factory=Pose)
    inks: Inks = field(default_factory=Inks)
    lamps: Light = field(default_factory=Light)
    surround: Surround = field(default_factory=Surround)
    pad: Pad = field(default_factory=Pad)
    lens: Lens = field(default_factory=Lens)
    sensor: Sensor = field(default_factory=Sensor)
    development: Development = field(default_factory=Development)
    seed: int = 0
