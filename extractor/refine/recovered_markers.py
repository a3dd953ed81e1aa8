"""Markers that synthesis has lost, as under dirt and glare, are measured by profiles.

The gridlines at the lost markers are read and weighted, and the lost markers are solved for, with the other markers
held, so that the time is proportional to these gridlines. Some other gridlines give the usual misfit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import markers as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import EdgeContrasts, Estimate


class LostMarkers(NamedTuple):
    """The markers to fill in, as ``fill_recovered_markers`` takes them."""

    lost: NDArray[np.bool_]
    xy: NDArray[np.float64]
    cov: NDArray[np.float64]


def fill_recovered_markers(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    contrasts: EdgeContrasts,
    places: InitialMarkers,
    lost: NDArray[np.bool_],
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
) -> None:
    """Fill in the lost markers whose gridlines look like the pattern.

    Args:
        view: the image.
        topology: of the layout.
        estimate: with its pattern at the markers of the last step.
        contrasts: across its gridlines.
        places: before refinement, in the view.
        lost: (M,) bool.
        xy, cov: (M, 2) px and (M, 2, 2) px^2, written; NaN where a lost marker is not accepted, or far from its place.
    """
    markers = LostMarkers(lost, xy, cov)
    native.fill_recovered_markers(view, estimate, contrasts, places, topology, markers)
