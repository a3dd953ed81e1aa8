"""Uncertain markers, as under dirt: the measurement is combined with the prediction by other markers."""

from __future__ import annotations

from typing import NamedTuple


class UncertainLimits(NamedTuple):
    """Limits of uncertain markers.

    Attributes:
        deviation: in edges, of a marker that others may predict better: at best to 0.012. Measured: rule "fusion".
    """

    deviation: float = 0.02


LIMITS = UncertainLimits()
