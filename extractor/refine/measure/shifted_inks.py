"""Markers and gridlines of pads whose inks lie off, each ink by itself.

Such a marker has two places: the one on which the inks agree in their mean, and the one where its gridlines cross as
they are seen, by least squares. The places differ, as each ink has two of the six gridlines. A point on a gridline has
two places, too: on the gridline that joins the markers, and on the one that is seen. All are stated in the middle
between both places, with half of the distance as a deviation that covers both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure as native
from extractor.layout.topology import Topology


class ShiftedInks(NamedTuple):
    """The shifts of the inks of a picture.

    Attributes:
        topology: of the layout.
        shift: (3, 2) in the layout, in units of the mean edge.
        lines: (E, 8), as ``gridlines`` gives them. maps: (M, 2, 5), as ``local_maps`` gives them.
    """

    topology: Topology
    shift: NDArray[np.float64]
    lines: NDArray[np.float64]
    maps: NDArray[np.float64]

    def markers(
        self, xy: NDArray[np.float64], cov: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Markers (M, 2) px and covariances (M, 2, 2) px^2, from the places on which the inks agree."""
        half = 0.5 * native.crossing_shifts(self.shift, self.lines, self.maps, self.topology)
        variance = 0.5 * (half**2).sum(axis=1)
        return xy + half, cov + variance[:, None, None] * np.eye(2)

    def points(self, points: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
        """Points (E, m, 3) of gridlines at full scale, from where they are seen; the lines are reduced by ``scale``."""
        half = 0.5 * scale * native.ink_offsets(self.shift, self.lines, self.maps, self.topology)
        ux, uy, variance = self.lines[:, 2], self.lines[:, 3], half**2
        # beside the white cell, the seen gridline is of two cells
        variance[(self.topology.edge_cells >= 0).all(axis=1)] = variance.max()
        return points + np.stack([half * uy, -half * ux, variance], axis=1)[:, None]
