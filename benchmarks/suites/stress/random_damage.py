"""Random damage of any color and size, on randomly deformed surfaces under random light."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks.suites.stress.damage import band, missing_cell_clusters, sample_places
from benchmarks.suites.stress.frames import RGB, PatternFrame
from benchmarks.suites.stress.kinds import ConditionKind, FrameChange, group_kinds
from cmpdesign.scene import Blob, Glare, Light, Press, Scratch, Shear, Twist, colored_leds
from cmpdesign.scene.parts.surface import Deformation

Rng = np.random.Generator
DamageFields = dict[str, Any]  # fields of a Damage
DamageSampler = Callable[[PatternFrame, Rng], DamageFields]


def sample_color(rng: Rng) -> RGB:
    """A random color with levels of 0 to 230."""
    red, green, blue = rng.uniform(0, 230, 3).tolist()
    return red, green, blue


def sample_long_scratches(frame: PatternFrame, rng: Rng) -> DamageFields:
    """Bands of random widths across the whole pattern, some over the white cell."""
    turns = rng.uniform(0, 2 * np.pi, rng.integers(1, 7))
    return {
        "scratches": tuple(
            band(frame, turn, rng.uniform(0.5, 7), float(rng.uniform(0.1, 1.4)), sample_color(rng))
            for turn in turns
        )
    }


def sample_short_scratches(frame: PatternFrame, rng: Rng) -> DamageFields:
    """Many thin scratches of random lengths, which leave fragments of cells."""
    common, bands = sample_color(rng), []
    own_colors = rng.random() < 0.5
    for start in sample_places(frame, int(rng.integers(5, 40)), 0.5):
        turn, length = rng.uniform(0, 2 * np.pi), rng.uniform(1, 8)
        end = start + length * np.array([np.cos(turn), np.sin(turn)])
        width_mm, (ax, ay), (bx, by) = float(rng.uniform(0.1, 0.6)), start.tolist(), end.tolist()
        rgb = sample_color(rng) if own_colors else common
        bands.append(Scratch((ax, ay), (bx, by), width_mm, rgb))
    return {"scratches": tuple(bands)}


def sample_blobs(frame: PatternFrame, rng: Rng) -> DamageFields:
    """Blobs of one color or of random colors."""
    common, own_colors, largest = sample_color(rng), rng.random() < 0.5, rng.uniform(0.3, 1.6)
    return {
        "blobs": tuple(
            Blob(
                (float(x), float(y)),
                float(rng.uniform(0.2, largest)),
                sample_color(rng) if own_colors else common,
            )
            for x, y in sample_places(frame, int(rng.integers(2, 25)), 0.8)
        )
    }


def sample_glare(frame: PatternFrame, rng: Rng) -> DamageFields:
    """Reflections at random positions, small and sharp or wide and faint."""
    width, height = frame.size
    return {
        "glare": tuple(
            Glare((float(x), float(y)), float(rng.uniform(4, 35)), float(rng.uniform(80, 400)))
            for x, y in rng.uniform(
                (0.2 * width, 0.1 * height), (0.8 * width, 0.9 * height), (rng.integers(1, 9), 2)
            )
        )
    }


def sample_missing_cells(frame: PatternFrame, rng: Rng) -> DamageFields:
    """A random share of missing cells."""
    return {"missing_share": float(rng.uniform(0.05, 0.4))}


def sample_missing_clusters(frame: PatternFrame, rng: Rng) -> DamageFields:
    """Missing groups of neighbouring cells."""
    damage = missing_cell_clusters(frame, float(rng.uniform(0.05, 0.4))).scene.damage
    assert damage is not None
    return {"missing_cells": damage.missing_cells}


def sample_bleeding(frame: PatternFrame, rng: Rng) -> DamageFields:
    return {"bleed_mm": float(rng.uniform(0.02, 0.12))}


def sample_combined(frame: PatternFrame, rng: Rng) -> DamageFields:
    """Two or three other samplers together."""
    chosen = rng.choice(len(SINGLE_SAMPLERS), rng.integers(2, 4), replace=False)
    parts: DamageFields = {}
    for number in chosen:
        for name, value in SINGLE_SAMPLERS[number](frame, rng).items():
            parts[name] = parts[name] + value if isinstance(parts.get(name), tuple) else value
    return parts


SINGLE_SAMPLERS: tuple[DamageSampler, ...] = (
    sample_long_scratches,
    sample_short_scratches,
    sample_blobs,
    sample_glare,
    sample_missing_cells,
    sample_missing_clusters,
    sample_bleeding,
)


def sample_deformed(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """The frame with up to two of press, twist and shear, tilted or not."""
    if rng.random() < 0.35:
        frame = frame.with_camera(
            tilt_deg=float(rng.uniform(5, 55)), tilt_axis_deg=float(rng.uniform(0, 180))
        )
    return frame.with_surface(*_sample_deformations(rng))


def _sample_deformations(rng: Rng) -> Iterator[Deformation]:
    def centre(reach_mm: float) -> tuple[float, float]:
        x, y = rng.uniform(-reach_mm, reach_mm, 2).tolist()
        return x, y

    kinds = rng.choice(3, rng.choice(3, p=(0.3, 0.5, 0.2)), replace=False)
    gentler = 0.6 if len(kinds) > 1 else 1.0
    sign = float(rng.choice((-1, 1)))
    if 0 in kinds:
        radius_mm = float(rng.uniform(3, 5))
        yield Press(radius_mm, sign * gentler * radius_mm * float(rng.uniform(0.08, 0.45)), centre(4))
    if 1 in kinds:
        yield Twist(float(rng.uniform(3.5, 5.5)), sign * gentler * float(rng.uniform(5, 28)), centre(3))
    if 2 in kinds:
        size, turn = gentler * rng.uniform(0.2, 1.4), rng.uniform(0, 2 * np.pi)
        yield Shear(4.0, (float(size * np.cos(turn)), float(size * np.sin(turn))), centre(2))


def sample_light(frame: PatternFrame, rng: Rng) -> PatternFrame:
    """The frame with unchanged light, colored LEDs, a gradient, or another color with vignetting."""
    choice = rng.integers(6)
    if choice == 0:
        return frame.with_parts(
            light=colored_leds(int(rng.integers(2, 4)), 0.7, float(rng.uniform(0.3, 0.7)))
        )
    if choice == 1:
        return frame.with_parts(light=Light(gradient=(float(rng.uniform(0.1, 0.6)), 0.0)))
    if choice == 2:
        red, green, blue = rng.uniform(0.5, 1.0, 3).tolist()
        return frame.with_parts(light=Light(rgb=(red, green, blue), vignetting=float(rng.uniform(0, 0.6))))
    return frame


def _make_change(draw: DamageSampler) -> FrameChange:
    def change(frame: PatternFrame, _: float) -> PatternFrame:
        rng = np.random.default_rng([frame.scene.seed, 91])
        return sample_light(sample_deformed(frame, rng), rng).damaged(**draw(frame, rng))

    return change


# The white cell may be hidden; therefore no share is promised.
RANDOM_KINDS = group_kinds(
    "drawn at random",
    *(
        ConditionKind(f"random {name}", "", (0,), _make_change(draw), promised=False)
        for name, draw in (
            ("scratches", sample_long_scratches),
            ("fragments", sample_short_scratches),
            ("blobs", sample_blobs),
            ("glare", sample_glare),
            ("cells missing", sample_missing_cells),
            ("clusters missing", sample_missing_clusters),
            ("damage", sample_combined),
        )
    ),
)
