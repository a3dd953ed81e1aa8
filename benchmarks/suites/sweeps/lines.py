"""The lines: for each set of inks and seed, a line of lamps, of levels of black, and of exposures; their reading.

All else is the standard scene's: a flat honeycomb of 7 layers, edges of 26 px, no white balance, noise of a sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np

from benchmarks.suites.camera.parts import PIGMENTS, Chain, Development, Inks, Pose, Sensor
from benchmarks.suites.camera.reading import WRONG_ID, cached_extractor, marker_outcomes
from benchmarks.suites.camera.shoot import shoot
from benchmarks.suites.sweeps.spectra import Spectrum, blackbody, inks_under, led_triple
from extractor.image.response import light_of_values

SEEDS = 3
LAMPS, BLACKS, EXPOSURES = "lamps", "black", "exposure"
DARK = Inks(
    red=(0.10, 0.012, 0.010), green=(0.010, 0.07, 0.015), blue=(0.010, 0.015, 0.10),
    white=(0.45, 0.45, 0.43), black=(0.006, 0.006, 0.006),
)  # fmt: skip
INK_SETS: tuple[Inks, ...] = (Inks(), *PIGMENTS, DARK)
TEMPERATURES = 20  # of black bodies, 2,000 to 15,000 K, in equal steps of 1 / T
LED_TRIPLES = 20  # round the circle of hues, at this power of the weakest LED
WEAKEST_LED = 0.15
BLACK_LEVELS = np.linspace(0, 90, 19)  # of 255, added to the darkest pixels
EXPOSURE_FACTORS = np.geomspace(0.3, 3.0, 20)
POSE = Pose(pattern="honeycomb", layers=7, pitch_px=26.0)


@dataclass(frozen=True)
class Line:
    """One line of pictures. ``kind``: what changes; ``inks``: the number of the set; ``seed``: of the noise."""

    kind: str
    inks: int
    seed: int


@dataclass(frozen=True)
class LineResult:
    """The steps of a line in order.

    Attributes:
        reasons: the reader's reason at each step; empty where the picture is read.
        wrong_ids: markers reported at another marker's place.
    """

    line: Line
    reasons: tuple[str, ...]
    wrong_ids: int

    @property
    def steps(self) -> int:
        return len(self.reasons)

    @property
    def read(self) -> int:
        return self.reasons.count("")

    @property
    def between(self) -> int:
        """Steps that are refused between two that are read."""
        is_read = np.array([not reason for reason in self.reasons])
        read = np.flatnonzero(is_read)
        return int((~is_read[read[0] : read[-1]]).sum()) if len(read) else 0


def make_lines(seeds: int = SEEDS) -> list[Line]:
    """All lines of a number of seeds."""
    return [
        Line(kind, inks, seed)
        for kind in (LAMPS, BLACKS, EXPOSURES)
        for inks in range(len(INK_SETS))
        for seed in range(seeds)
    ]


@cache
def lamp_spectra() -> tuple[Spectrum, ...]:
    """The lamps of a line: black bodies from warm to cold, then LED triples round the circle of hues."""
    mired = np.linspace(1e6 / 2000, 1e6 / 15000, TEMPERATURES)
    warm_to_cold = [blackbody(1e6 / value) for value in mired.tolist()]
    triples = []
    for step in range(LED_TRIPLES):
        phases = [2 * math.pi * (step / LED_TRIPLES - channel / 3) for channel in range(3)]
        red, green, blue = (
            WEAKEST_LED + (1 - WEAKEST_LED) * (0.5 + 0.5 * math.cos(phase)) for phase in phases
        )
        triples.append(led_triple((red, green, blue)))
    return (*warm_to_cold, *triples)


def line_chains(line: Line) -> list[Chain]:
    """The pictures of a line."""
    inks = INK_SETS[line.inks]
    plain = Chain(pose=POSE, inks=inks, development=Development(balance=0.0), seed=line.seed)
    if line.kind == LAMPS:
        return [replace(plain, inks=inks_under(lamp, inks)) for lamp in lamp_spectra()]
    if line.kind == BLACKS:
        lifted = np.interp(BLACK_LEVELS, np.arange(256), light_of_values("srgb")) / 255.0
        return [replace(plain, sensor=Sensor(lifted_black=level)) for level in lifted.tolist()]
    return [replace(plain, sensor=Sensor(exposure=factor)) for factor in EXPOSURE_FACTORS.tolist()]


def read_line(line: Line) -> LineResult:
    """Shoot and read every picture of a line; one thread."""
    cv2.setNumThreads(1)
    extractor = cached_extractor(POSE.pattern, POSE.layers, "balanced")
    reasons, wrong_ids = [], 0
    for chain in line_chains(line):
        picture = shoot(chain)
        markers = extractor.extract(picture.image)
        reasons.append(str(markers.reason or ""))
        wrong_ids += int((marker_outcomes(picture, markers) == WRONG_ID).sum())
    return LineResult(line, tuple(reasons), wrong_ids)
