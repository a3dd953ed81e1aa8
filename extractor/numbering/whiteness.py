"""Measures the inks, and the brightness and whiteness of predicted places.

The brightness is the sum of the channels, relative to that of the inks around. In light of any color, each channel of
white is about as strong as in the ink with most of that channel; colored dirt has a weaker channel. The whiteness is
the weakest of these ratios.
"""

from __future__ import annotations

from typing import NamedTuple


class WhitenessLimits(NamedTuple):
    """Limits of whiteness.

    Attributes:
        sample_radius: of a color sample, relative to the square root of the cell's area. Chosen.
    """

    sample_radius: float = 0.1


LIMITS = WhitenessLimits()
