"""The pictures of a run: no effect, each effect alone at graded strength, all effects combined at random.

A run's seed and a picture's number fix the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.suites.camera.effects import EFFECTS
from benchmarks.suites.camera.parts import PATTERNS, SIZE_PX, Chain, Lens, Pose

PLAIN, COMBINED = "none", "combined"
STRENGTHS = (0.25, 0.5, 0.75, 1.0)
COMBINED_SHARE = 0.6  # probability of each effect in a combined picture
COMBINED_TURNS = 7  # combined pictures for each picture of every single effect
TURN = (PLAIN, *EFFECTS, *[COMBINED] * COMBINED_TURNS)
KINDS = (PLAIN, *EFFECTS, COMBINED)
PITCH_PX = (13.0, 30.0)
MAX_TILT_DEG, FLAT_SHARE = 40.0, 0.4
MAX_LAYERS, MIN_LAYERS = 11, 4
FILLED_SHARE = 0.9  # of the image's height that the pattern takes at most, as long as it has ``MIN_LAYERS``
ROW_PITCHES = 0.93  # height of a layer in pitches, the mean of the patterns and their orientations
BLUR_PX = (0.6, 1.1)


@dataclass(frozen=True)
class CameraCase:
    """One picture of a run.

    Attributes:
        seed: of the run.
        number: of the picture, from 0.
    """

    seed: int
    number: int

    @property
    def kind(self) -> str:
        """``PLAIN``, ``COMBINED``, or the name of an effect."""
        return TURN[self.number % len(TURN)]

    @property
    def strength(self) -> float:
        """0 without an effect, or one of ``STRENGTHS``. The kinds have all strengths in turn."""
        turn = self.number // len(TURN) + self.number % len(TURN)
        return 0.0 if self.kind == PLAIN else STRENGTHS[turn % len(STRENGTHS)]

    @property
    def name(self) -> str:
        """``kind=strength/number``; with the run's seed it stands for the picture."""
        return f"{self.kind}={self.strength:g}/{self.number}"


def make_cases(pictures: int, seed: int) -> list[CameraCase]:
    """The first pictures of a run."""
    return [CameraCase(seed, number) for number in range(pictures)]


def sample_chain(case: CameraCase) -> Chain:
    """The chain of a case: pattern and pose at random, then the effects in the order of a camera."""
    rng = np.random.default_rng([case.seed, case.number])
    pose = sample_pose(rng)
    lens = Lens(blur_px=float(rng.uniform(*BLUR_PX)))
    chain = Chain(pose=pose, lens=lens, seed=int(rng.integers(2**31)))
    for name, effect in EFFECTS.items():
        if case.kind == name:
            chain = effect(chain, case.strength, rng)
        elif case.kind == COMBINED and rng.random() < COMBINED_SHARE:
            chain = effect(chain, case.strength * float(rng.uniform(0, 1)), rng)
    return chain


def sample_pose(rng: np.random.Generator) -> Pose:
    """A random pattern that fits into the image at a random pitch, turned, and tilted or not."""
    pitch_px = float(np.exp(rng.uniform(*np.log(PITCH_PX))))
    fitting = int(FILLED_SHARE * SIZE_PX[1] / (2 * ROW_PITCHES * pitch_px))
    tilted = rng.random() >= FLAT_SHARE
    offset_x, offset_y = rng.uniform(-12, 12, 2).tolist()
    return Pose(
        pattern=str(rng.choice(PATTERNS)),
        layers=min(max(fitting, MIN_LAYERS), MAX_LAYERS),
        pitch_px=pitch_px,
        roll_deg=float(rng.uniform(0, 360)),
        tilt_deg=float(rng.uniform(5, MAX_TILT_DEG)) if tilted else 0.0,
        tilt_axis_deg=float(rng.uniform(0, 180)),
        centre_px=((SIZE_PX[0] - 1) / 2 + offset_x, (SIZE_PX[1] - 1) / 2 + offset_y),
    )
