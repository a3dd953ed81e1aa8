"""The presets: points on the curve of time against error."""

from __future__ import annotations

from typing import Literal, NamedTuple

Preset = Literal["fast", "balanced", "accurate"]
PRESETS: tuple[Preset, ...] = ("fast", "balanced", "accurate")


class Schedule(NamedTuple):
    """The schedule of refinement of a preset: a round of profiles, then steps by synthesis or a second round.

    Attributes:
        max_profile_rows: rows of pixels across each gridline at most, in the first round of profiles, and in the
            second one if no synthesis follows.
        reduction_blur_px: blur (sigma, px) down to which the image may be reduced; blurred images need no fine pixels.
        sharp_blur_share: blur as a share of the edges, below which a second round of profiles replaces
            synthesis.
        steps: number of steps by synthesis at most, each over all markers.
        small_move: standard deviations, the typical move of markers in a step after which no step follows. A further
            step would move them by about a fifth of it. Measured with `python -m benchmarks.ablation --rule
            "small move"`: it saves a quarter to two fifths of the steps, for 1 % of the RMS of a picture.
    """

    max_profile_rows: tuple[int, int]
    reduction_blur_px: float
    sharp_blur_share: float
    steps: int
    small_move: float


SCHEDULES: dict[Preset, Schedule] = {
    "fast": Schedule((2, 64), 0.5, 0.0875, 2, 0.5),
    "balanced": Schedule((6, 6), 0.5, 0.0, 3, 0.5),
    "accurate": Schedule((8, 8), 1.2, 0.0, 4, 0.25),
}
