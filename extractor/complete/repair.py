"""Repair: markers that contradict their neighbours are dropped, and lost markers are repaired where their neighbours
leave no doubt.

Mild omission (the article's eq. 6): the triangles around a lost marker give its place; here all markers of two rings
give it, through one local quadratic map. Heavy omission (Fig. 8): a quadratic through the markers of the same layer and
sextant, read at equidistant places. A marker that neither method predicts within a tenth of an edge stays lost.

The prediction by the rings of an uncertain marker, as under dirt, may be better than its measurement: both are
combined.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class RepairedMarkers(NamedTuple):
    """Markers after repair.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2) float64, NaN where lost.
        status: (M,) uint8, a ``Status`` each.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    status: NDArray[np.uint8]
