"""The square pattern: the former CMP, the baseline of comparisons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.patterns import PatternShape, register_pattern
from cmpdesign.patterns.graphs import SQUARE_GRAPHS
from cmpdesign.patterns.numbering import Ints


@register_pattern("square", SQUARE_GRAPHS)
def square_positions(layer: Ints, index: Ints, shape: PatternShape) -> NDArray[np.float64]:
    """A black-and-white checkerboard, red at its centre; markers in rows (the article, section II).

    ::

       0---1---2---3       |<->| pitch: every edge
       |   |###|   |
       4---5---6---7       layer = row, index = column, from the top left
       |###|red|###|
       8---9--10--11       layers = 1: one ring of cells around the red one
       |   |###|   |
      12--13--14--15
    """
    return np.stack([index.astype(np.float64), -layer.astype(np.float64)], axis=-1)
