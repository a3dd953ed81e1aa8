"""The pixels near a gridline, row by row across the gridline."""

from __future__ import annotations

from typing import NamedTuple


class PixelRowLimits(NamedTuple):
    """Limits of the pixels near a gridline.

    Attributes:
        band: in units of the blur, the distance from a gridline within which pixels count. The polynomials of
            ``pixel_weights.hpp`` hold up to 0.4 more. Derived: erf(2.2), 99.8 % of what a gridline tells, lies within.
    """

    band: float = 2.2


LIMITS = PixelRowLimits()
