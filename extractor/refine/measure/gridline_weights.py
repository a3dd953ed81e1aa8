"""The gridlines' weights by their misfit, the lengths of the gridlines, and the markers after a step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure as native

SHORTEST_RARITY = 100  # one in so many gridlines is shorter than a short edge; chosen


def short_edge(xy: NDArray[np.float64], edges: NDArray[np.int32], rarity: int) -> float:
    """The length, px, that all edges exceed except for one in ``rarity``; 0 without any known edge.

    Args:
        xy: (M, 2) px, NaN where unknown.
        edges: (E, 2) marker ids.
        rarity: at least 1.
    """
    return native.short_edge(np.ascontiguousarray(xy), np.ascontiguousarray(edges), rarity)
