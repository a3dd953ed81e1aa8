"""The honeycomb pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS
from cmpdesign.patterns.numbering import Ints, axial_from_layer


@register_pattern("honeycomb", TRIANGULAR_GRAPHS)
def honeycomb_positions(layer: Ints, index: Ints, shape: PatternShape) -> NDArray[np.float64]:
    """Equilateral triangles; the layers are regular hexagons (the article, fig. 3a).

    ::

           *---*---*
          / \\ / \\ / \\        |<->| pitch: every edge
         *---*---*---*
        / \\ / \\ / \\ / \\      layers = 2
       *---*---0---*---*
        \\ / \\ / \\ / \\ /
         *---*---*---*
          \\ / \\ / \\ /
           *---*---*
    """
    q, r = axial_from_layer(layer, index)
    return np.stack([q + r / 2, r * (np.sqrt(3) / 2)], axis=-1)
