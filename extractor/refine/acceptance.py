"""The final tests of markers, and the treatment of those that are covered."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import markers as native
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import Estimate


class FinalMarkers(NamedTuple):
    """The M markers after the tests.

    Attributes:
        xy_px, cov_px2: (M, 2) and (M, 2, 2), NaN where not accepted.
        unaccepted: (M,) bool, the markers with a start that are not accepted, or that the image shows little.
        all_accepted: there is none of these.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    unaccepted: NDArray[np.bool_]
    all_accepted: bool


def accept_markers(estimate: Estimate, places: InitialMarkers, topology: Topology) -> FinalMarkers:
    """The markers that lie near their start place with a small deviation.

    Dirt on some gridlines of a marker moves the others, too, and adds to the covariance. Where the drawing does not
    explain the image, markers far from their start are not accepted.

    Args:
        estimate: after the last step.
        places: before refinement.
        topology: of the layout.
    """
    return native.accept_markers(estimate, places, topology)


def update_lost_markers(
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
    unaccepted: NDArray[np.bool_],
    predicted: NDArray[np.float64],
    start: NDArray[np.float64],
    edge: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """The markers that are lost.

    Args:
        xy, cov: (M, 2) px and (M, 2, 2) px^2; unaccepted markers far from where they are predicted become NaN.
        unaccepted: (M,) bool.
        predicted: (M, 2) px, the markers by their neighbours.
        start, edge: (M, 2) px, (M,) px, as in ``InitialMarkers``.

    Returns:
        (M,) bool, the markers with a start that are not accepted.
    """
    return native.update_lost_markers(xy, cov, unaccepted, predicted, start, edge)
