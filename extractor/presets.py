"""The presets: points on the curve of time against error."""

from __future__ import annotations

from typing import Literal, NamedTuple

Preset = Literal["balanced", "accurate"]
PRESETS: tuple[Preset, ...] = ("balanced", "accurate")


class Schedule(NamedTuple):
    """The schedule of refinement of a preset: a round of profiles, then steps by synthesis.

    Attributes:
        max_profile_rows: rows of pixels across each gridline at most, in the round of profiles.
        reduction_blur_px: blur (sigma, px) down to which the image may be reduced; blurred images need no fine pixels.
        small_remainder: standard deviations, the error that a step typically leaves (``remaining_share``) at which no
            step follows, if nothing but the markers has changed. Errors rise by half of its square at most: by 3 %
            (balanced). Measured: rule "small remainder".
    """

    max_profile_rows: int
    reduction_blur_px: float
    small_remainder: float


SCHEDULES: dict[Preset, Schedule] = {
    "balanced": Schedule(6, 0.5, 0.25),
    "accurate": Schedule(8, 1.2, 0.1),
}
