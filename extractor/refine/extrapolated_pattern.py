"""Markers with those just beyond them, where the maps of the known markers put them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.layout.topology import Topology


class ExtrapolatedPattern(NamedTuple):
    """Markers, with the markers next to known markers.

    Attributes:
        xy: (M, 2) px; unknown markers beside known markers lie at the places by the maps of the known markers.
        hidden: (M,) bool, the markers that were placed in this way.
        maps: (M, 2, 5) the map at each marker, as ``local_maps`` gives it.
    """

    xy: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]


def extrapolate_pattern(xy: NDArray[np.float64], topology: Topology) -> ExtrapolatedPattern:
    """The markers (M, 2), NaN where unknown, with the markers next to known markers."""
    return native.extrapolate_pattern(xy, topology)
