"""A new pattern: one function gives the places of the markers; all other parts follow from it.

    cmpdesign --load examples/my_own_pattern.py build honeycomb --set pattern=swirl --set layers=6 -o swirl

In Python, import the file before the design. A file of this kind in cmpdesign/patterns/ needs no --load.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import TRIANGULAR_GRAPHS
from cmpdesign.patterns.numbering import Ints

TURN_DEG = 8.0  # from layer to layer


@register_pattern("swirl", TRIANGULAR_GRAPHS)
def swirl_positions(layer: Ints, index: Ints, shape: PatternShape) -> NDArray[np.float64]:
    """Circles one pitch apart, each turned against the next, so that no gridline is radial.

    ::

           .-*---.
         *`   \\  `*        marker i of layer k: radius k pitches,
        /  `.  \\ .` \\      angle 120 - 60 i / k + 8 k degrees
        *---- 0 ----*
    """
    angle = np.radians(120 - 60 * index / np.maximum(layer, 1) + TURN_DEG * layer)
    return np.asarray(layer[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
