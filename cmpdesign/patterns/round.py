"""The round pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS
from cmpdesign.patterns.numbering import Ints


@register_pattern("round", TRIANGULAR_GRAPHS)
def round_positions(layer: Ints, index: Ints, shape: PatternShape) -> NDArray[np.float64]:
    """Layers are concentric circles, one pitch apart, their markers at equal angles (the article, fig. 3c).

    ::

            . -*- .
         *          *        |<->| pitch: from circle to circle
        /   . -*- .  \\
       |  *         * |
       *  |   0   |   *      marker i of layer k lies at 120 - 60 i / k degrees
       |  *         * |
        \\   ' -*- '  /
         *          *
            ' -*- '
    """
    angle = np.radians(120 - 60 * index / np.maximum(layer, 1))
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.asarray(layer[..., None] * circle)
