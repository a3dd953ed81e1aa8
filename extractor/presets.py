"""The presets: points on the curve of time against error."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

Preset = Literal["fast", "balanced", "accurate"]
PRESETS: tuple[Preset, ...] = ("fast", "balanced", "accurate")


class Schedule(NamedTuple):
    """The schedule of refinement steps of a preset.

    Attributes:
        max_profile_rows: rows of pixels across each gridline at most, in the first round of profiles, and in the
            second one if no synthesis follows.
        reduction_blur_px: blur (sigma, px) down to which the image may be reduced; blurred images need no fine pixels.
        sharp_blur_share: blur as a share of the edges, below which an image needs no synthesis,
        cheap_reduction: unless the image could be reduced by this factor, which makes synthesis cheap.
        max_synthesis_effort: cost that synthesis may have, in units of one full step with edges of 10 px; two steps
            are always allowed.
        converged_deviations: steps end when no marker moves by more than this number of its standard deviations
        converged_blur_share: and by more than this share of the blur, or less where gridlines are short,
        max_moving_share: except for this share of the markers;
        patience: or when after this number of further steps no fewer markers move: their moves are then nothing that
            synthesis could explain.
        max_partial_share: a partial step redraws the moving markers and their neighbours; it leaves out the neighbours
            where both are more than twice this share of all markers, of which no more than this share moves.
        max_partial_share_in_dirt: where dirt moves the markers, and both are more than ``max_partial_share``, a partial
            step redraws only this share, the markers that move the farthest.
        max_steps_in_dirt: number of steps after which no partial step is done for markers in dirt.
    """

    max_profile_rows: tuple[int, int]
    reduction_blur_px: float
    sharp_blur_share: float
    cheap_reduction: float
    max_synthesis_effort: float
    converged_deviations: float
    converged_blur_share: float
    max_moving_share: float
    patience: int
    max_partial_share: float
    max_partial_share_in_dirt: float
    max_steps_in_dirt: int


SCHEDULES: dict[Preset, Schedule] = {
    "fast": Schedule(
        max_profile_rows=(2, 64),
        reduction_blur_px=0.5,
        sharp_blur_share=0.0875,
        cheap_reduction=np.inf,
        max_synthesis_effort=0.0,
        converged_deviations=0.0,
        converged_blur_share=0.0,
        max_moving_share=0.0,
        patience=1,
        max_partial_share=1.0,
        max_partial_share_in_dirt=1.0,
        max_steps_in_dirt=1,
    ),
    "balanced": Schedule(
        max_profile_rows=(6, 64),
        reduction_blur_px=0.5,
        sharp_blur_share=0.085,
        cheap_reduction=2,
        max_synthesis_effort=4.0,
        converged_deviations=2.0,
        converged_blur_share=0.03,
        max_moving_share=0.0,
        patience=1,
        max_partial_share=0.5,
        max_partial_share_in_dirt=0.05,
        max_steps_in_dirt=1,
    ),
    "accurate": Schedule(
        max_profile_rows=(8, 8),
        reduction_blur_px=1.2,
        sharp_blur_share=0.0,
        cheap_reduction=1,
        max_synthesis_effort=26.0,
        converged_deviations=0.7,
        converged_blur_share=0.0,
        max_moving_share=0.0,
        patience=2,
        max_partial_share=1.0,
        max_partial_share_in_dirt=1.0,
        max_steps_in_dirt=9,
    ),
}
