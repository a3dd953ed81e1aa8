"""Edge profiles: the colors across each gridline as a profile from 1 to 0, and the blur of that profile.

Profiles are read between the corners of a gridline only (``matched_filter``). They are fast, and converge from a start
that is a pixel off.
"""

from __future__ import annotations

from typing import NamedTuple

from extractor.refine.measure.matched_filter import LIMITS as ROW_LIMITS


class EdgeProfileLimits(NamedTuple):
    """Limits of profiles and of their blur.

    Attributes:
        min_contrast: gray levels; a gridline with less is not read. Chosen.
        min_sine: of the angles at a gridline's ends, at least. Chosen.
        max_reach: of the cell's height, the reach of a profile to each side. Derived: as in ``MatchedFilterLimits``.
        max_reach_share: of the distance to the next gridline, the reach of a blur profile; 0.41 in a regular cell.
            Chosen.
        middle_share: of the gridline, from its ends to the nearest of the profiles. Chosen.
        min_blur_gridlines: clear of other gridlines, below which all gridlines are taken. Chosen.
        bilinear_px2: px^2, mean variance that bilinear sampling adds to the blur. Derived: the mean of f (1 - f) over
            the fractions f of a pixel.
        apparent_blur, true_blur: in units of the cell's height, one for the other. Wide blur mixes the neighbours' inks
            into the middles that the contrasts are taken from, which makes profiles look too steep (rendered
            honeycombs). The native code has room for as many. Measured on these, by no command that is kept.
    """

    min_contrast: float = 12.0
    min_sine: float = 0.05
    max_reach: float = ROW_LIMITS.max_reach
    max_reach_share: float = 0.45
    middle_share: float = 0.4
    min_blur_gridlines: int = 12
    bilinear_px2: float = 1.0 / 6.0
    apparent_blur: tuple[float, ...] = (0.0, 0.092, 0.112, 0.128, 0.137, 0.149, 0.154)
    true_blur: tuple[float, ...] = (0.000, 0.093, 0.117, 0.140, 0.160, 0.195, 0.225)


LIMITS = EdgeProfileLimits()
