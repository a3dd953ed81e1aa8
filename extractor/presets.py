"""The presets: points on the curve of time against error."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

Preset = Literal["fast", "balanced", "accurate"]
PRESETS: tuple[Preset, ...] = ("fast", "balanced", "accurate")


class Schedule(NamedTuple):
    """What a preset does.

    Attributes:
        profiles: rows of pixels across each gridline at most, in the first round, and in the second, if no synthesis
            follows.
        finest: blur (px, sigma) that the image may be reduced to: what is blurred needs no fine pixels.
        sharp: blur, as a share of the edges, below which an image needs no synthesis,
        reduced: unless it could be reduced by so much, which makes synthesis cheap.
        effort: what synthesis may cost, in units of a step from everything with edges of 10 px; two steps are
            allowed in any case.
        enough: no more steps once no marker moves by more than so many of its standard deviations
        near: and by more than this share of the blur, or less where gridlines are short,
        few: but for this share of the markers;
        patience: or once no fewer move after so many more: what moves them is nothing that a drawing could explain.
        many: with the markers that move, those beside them are drawn anew, unless these are more than twice this share,
            but fewer than that move; once they are more than this in dirt, only
        most: so many that move the farthest, and there are
        in_dirt: no more steps around markers than these.
    """

    max_profile_rows: tuple[int, int]
    reduction_blur_px: float
    sharp_blur_share: float
    reduced: float
    max_synthesis_effort: float
    converged_deviations: float
    near: float
    max_moving_share: float
    patience: int
    max_partial_share: float
    max_partial_share_in_dirt: float
    max_steps_in_dirt: int


SCHEDULES: dict[Preset, Schedule] = {
    "fast": Schedule((2, 64), 0.5, 0.0875, np.inf, 0.0, 0.0, 0.0, 0.0, 1, 1.0, 1.0, 1),
    "balanced": Schedule((6, 64), 0.5, 0.085, 2, 1.95, 5.0, 0.08, 0.0125, 1, 0.3, 0.05, 1),
    "accurate": Schedule((8, 8), 1.2, 0.0, 1, 26.0, 0.7, 0.0, 0.0, 2, 1.0, 1.0, 9),
}
