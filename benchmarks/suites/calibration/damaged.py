"""Damaged patterns: mild dirt, the four kinds of damage on three surfaces, and a sample of the stress suite."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.suites.calibration.cases import CalibrationCase, frame_case, random_view
from benchmarks.suites.scenes import SceneCase, standard_layout
from benchmarks.suites.stress.conditions import BY_NAME, make_cases
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame
from benchmarks.suites.stress.kinds import make_frame
from cmpdesign.scene import Blob, Camera, Damage, Press, Scratch, Twist, composed, standard_scene
from cmpdesign.scene.standard import BLACK_RGB

DIRT_RGB = (120.0, 110.0, 100.0)
REACH_MM = 8.0  # from the centre; edges are 1 mm long
MILD_KINDS = ("specks", "fine scratches")
MILD_SURFACES = ("flat", "bulge", "twist")
MILD_VIEWS = 4  # per kind, surface and pattern
DAMAGE_KINDS = ("cells missing", "dirt", "dark dirt", "blots")
DAMAGE_LAYERS, DAMAGE_DRAWS = 9, 3
DAMAGE_SIZE = (430, 400)
DAMAGE_SURFACES = (
    None,
    composed(Press(radius_mm=5.0, depth_mm=1.0)),
    composed(Twist(radius_mm=5.0, angle_deg=15.0)),
)
EVERY_NTH_IF_QUICK = 6


def sample_spots(
    rng: np.random.Generator, count: int, radii_mm: tuple[float, float], rgb: tuple[float, float, float]
) -> tuple[Blob, ...]:
    """Round spots on the pattern but not on its centre; ``rng`` is advanced."""
    angle, radius = rng.uniform(0, 2 * np.pi, count), REACH_MM * np.sqrt(rng.uniform(0.04, 1, count))
    sizes = rng.uniform(*radii_mm, count)
    places = zip(radius * np.cos(angle), radius * np.sin(angle), sizes, strict=True)
    return tuple(Blob((float(x), float(y)), float(r), rgb) for x, y, r in places)


def sample_mild_damage(kind: str, rng: np.random.Generator) -> Damage:
    """Eight specks with radii of 0.1 to 0.3 edges, or three scratches 0.1 edges wide; ``rng`` is advanced."""
    if kind == "specks":
        return Damage(blobs=sample_spots(rng, 8, (0.1, 0.3), DIRT_RGB))
    scratches = []
    for spot in sample_spots(rng, 3, (1.0, 3.0), DIRT_RGB):  # the radius is the length
        turn = rng.uniform(0, 2 * np.pi)
        start = np.array(spot.centre_mm)
        end = start + spot.radius_mm * np.array([np.cos(turn), np.sin(turn)])
        scratches.append(Scratch(spot.centre_mm, (float(end[0]), float(end[1])), 0.1, DIRT_RGB))
    return Damage(scratches=tuple(scratches))


def mild_dirt_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """A few specks or fine scratches on three surfaces, all patterns, random rotations."""
    for number, kind in enumerate(MILD_KINDS):
        for surface in MILD_SURFACES:
            for pattern in PATTERNS:
                case = SceneCase(pattern, surface)
                place = [MILD_SURFACES.index(surface), PATTERNS.index(pattern)]
                rng = np.random.default_rng([seed, 3, number, *place])
                for _ in range(1 if quick else MILD_VIEWS):
                    damaged = random_view(case, rng).with_parts(damage=sample_mild_damage(kind, rng))
                    yield frame_case(kind, case, damaged)


def sample_damages(seed: int) -> Iterator[Damage]:
    """One damage of each of ``DAMAGE_KINDS``: missing cells, dirt, dark dirt, two large blots."""
    rng = np.random.default_rng(seed)
    yield Damage(missing_share=0.12)
    yield Damage(blobs=sample_spots(rng, 8, (0.4, 1.2), DIRT_RGB))
    yield Damage(blobs=sample_spots(rng, 8, (0.4, 1.2), BLACK_RGB))
    yield Damage(blobs=sample_spots(rng, 2, (2.0, 2.4), BLACK_RGB))


def damage_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """Every kind of damage on a flat, a pressed and a twisted surface, all patterns."""
    draws = 1 if quick else DAMAGE_DRAWS
    for pattern in PATTERNS:
        layout = standard_layout(pattern, DAMAGE_LAYERS)
        for number, surface in enumerate(DAMAGE_SURFACES):
            camera = Camera(20.0, 7.3, 10.0 * number, 30.0)
            plain = replace(standard_scene(layout), surface=surface, camera=camera)
            for draw in range(draws):
                drawn = sample_damages(1000 * seed + DAMAGE_DRAWS * number + draw)
                for place, (kind, damage) in enumerate(zip(DAMAGE_KINDS, drawn, strict=True)):
                    noise_seed = 1000 * seed + len(DAMAGE_KINDS) * draw + place
                    scene = replace(plain, damage=damage, seed=noise_seed)
                    yield CalibrationCase(kind, layout, PatternFrame(scene, DAMAGE_SIZE).shoot)


def stress_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """One picture per condition of the stress suite, the patterns in turn, by group; none without a pattern."""
    chosen = [case for case in make_cases(quick=True) if BY_NAME[case.kind].group != "nothing"]
    for case in chosen[:: EVERY_NTH_IF_QUICK if quick else 1]:
        seeded = replace(case, seed=case.seed + 1000 * seed)
        kind = BY_NAME[case.kind]
        frame = make_frame(seeded, kind)
        if isinstance(frame, PatternFrame):
            yield CalibrationCase(kind.group, standard_layout(case.pattern, frame_layers(frame)), frame.shoot)


def frame_layers(frame: PatternFrame) -> int:
    """The number of layers of the frame's pattern."""
    return int(frame.layout.marker_layer.max())
