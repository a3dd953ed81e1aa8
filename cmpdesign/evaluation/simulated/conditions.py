"""Light, blur, noise and dirt of one picture, sampled from a sensor's ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmpdesign.scene import Blob, Damage, Led, Light
from cmpdesign.sensor.tables import ConditionRanges

# Range of the gray level of a bubble or a grain of dirt, 0 to 255.
SPECK_LEVEL = (40.0, 200.0)


@dataclass(frozen=True)
class ImagingConditions:
    """The conditions of one picture."""

    light: Light
    blur_px: float
    noise: float
    damage: Damage | None


def sample_conditions(
    ranges: ConditionRanges, rng: np.random.Generator, half_window_mm: float
) -> ImagingConditions:
    """Conditions sampled uniformly from the ranges; specks lie within the half window around the middle."""
    level = rng.uniform(*ranges.level)
    rgb = level * (1 + rng.uniform(-ranges.tint, ranges.tint, 3))
    gradient = rng.uniform(-ranges.gradient, ranges.gradient, 2)
    vignetting = rng.uniform(*ranges.vignetting)
    lamps = [_sample_lamp(ranges, rng) for _ in range(rng.integers(ranges.lamps[0], ranges.lamps[1] + 1))]
    light = Light(
        rgb=(float(rgb[0]), float(rgb[1]), float(rgb[2])),
        gradient=(float(gradient[0]), float(gradient[1])),
        vignetting=float(vignetting),
        leds=tuple(lamps),
    )
    blur_px, noise = float(rng.uniform(*ranges.blur_px)), float(rng.uniform(*ranges.noise))
    count = int(rng.integers(ranges.specks[0], ranges.specks[1] + 1))
    specks = tuple(_sample_speck(ranges, rng, half_window_mm) for _ in range(count))
    return ImagingConditions(light, blur_px, noise, Damage(blobs=specks) if specks else None)


def mean_conditions(ranges: ConditionRanges) -> ImagingConditions:
    """The middle of the ranges, with uniform light, no lamps and no specks."""
    level = float(np.mean(ranges.level))
    light = Light(rgb=(level, level, level), vignetting=float(np.mean(ranges.vignetting)))
    return ImagingConditions(light, float(np.mean(ranges.blur_px)), float(np.mean(ranges.noise)), None)


def _sample_lamp(ranges: ConditionRanges, rng: np.random.Generator) -> Led:
    level = float(rng.uniform(0, ranges.lamp_level))
    return Led(float(rng.uniform(0, 360)), (level, level, level))


def _sample_speck(ranges: ConditionRanges, rng: np.random.Generator, half_window_mm: float) -> Blob:
    x, y = rng.uniform(-half_window_mm, half_window_mm, 2)
    gray = float(rng.uniform(*SPECK_LEVEL))
    return Blob((float(x), float(y)), float(rng.uniform(*ranges.speck_radius_mm)), (gray, gray, gray))
