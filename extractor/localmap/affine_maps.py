"""Local linear maps from the layout to the image around every numbered cell, in pixels per millimetre."""

from __future__ import annotations

from typing import NamedTuple


class AffineMapLimits(NamedTuple):
    """Limits of linear maps.

    Attributes:
        min_spread: least ratio of the neighbours' spread across to along; below it they lie on one line. Chosen.
        max_misfit: of the distance to a neighbour, from its center to the prediction by a triangle. Measured: rule
            "mapped by triangle".
        min_rival_misfit: the same for the triangle rotated by 120 degrees, which mispredicts by 1.7 distances. Chosen
            below that.
    """

    min_spread: float = 0.2
    max_misfit: float = 0.3
    min_rival_misfit: float = 0.8


LIMITS = AffineMapLimits()
