"""The final tests of markers, and the treatment of those that are covered."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import markers as native
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import MAX_PLACE_ERROR, InitialMarkers
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import LIMITS as BENDING_LIMITS
from extractor.refine.refinement_step import PRIOR_PX
from extractor.refine.solve.fisher_information import LIMITS as INFORMATION_LIMITS
from extractor.refine.solve.fisher_information import InformationLimits


class AcceptanceLimits(NamedTuple):
    """Limits of accepted markers, in units of the edges around the marker where nothing else is said.

    Attributes:
        max_shift: from the start place. Chosen.
        max_shift_all_cells: the same where all triangles agree on that: in steep views these lie so far off. Chosen.
        max_deviation: of what is measured. Chosen: as many markers at the rim are accepted as with 0.03, when their
            deviations were stated as if they had neighbours on all sides.
        min_information: 1/px^2, below which a marker counts as unknown: four times that before the measurement.
            Derived.
        bend_to_end_shift: the shift of a gridline's ends that remains, in deviations of its bending. Derived: as in
            ``BendingLimits``.
        information: of the covariances.
    """

    max_shift: float = 0.25
    max_shift_all_cells: float = 0.13
    max_deviation: float = 0.035
    min_information: float = 4 * PRIOR_PX**-2
    bend_to_end_shift: float = BENDING_LIMITS.bend_to_end_shift
    information: InformationLimits = INFORMATION_LIMITS


class HiddenMarkerLimits(NamedTuple):
    """Limits of markers that dirt hides, in units of the edges around the marker where nothing else is said.

    Attributes:
        max_shift_unexplained: from the start place, where the drawing explains nothing well. Chosen.
        max_shift_from_prediction: from where the neighbours put an unaccepted marker. Chosen.
        dot_gain_factor: times the dot gain, added to ``max_shift_unexplained``: corners move most. Chosen.
        unexplained_deviation: by dirt, of the visible part where the drawing does not explain the image. Chosen.
        dirt_deviation: by dirt, where it does, but no gridline of the marker has any weight. Chosen.
        disagreement_scale: of profiles and triangles, where all triangles of a marker were found. Chosen.
        max_place_error: between a marker's place by its gridlines and a correct initial place. Derived: as in
            ``marker_places``.
    """

    max_shift_unexplained: float = 0.13
    max_shift_from_prediction: float = 0.05
    dot_gain_factor: float = 2.0
    unexplained_deviation: float = 0.015
    dirt_deviation: float = 0.01
    disagreement_scale: float = 0.03
    max_place_error: float = MAX_PLACE_ERROR


LIMITS = AcceptanceLimits()
HIDDEN_MARKER_LIMITS = HiddenMarkerLimits()


class FinalLimits(NamedTuple):
    """Limits of the markers after the last step.

    Attributes:
        unexplained_noise_ratio: noise of the drawing over that of the pixels, above which the drawing explains too
            little to move a marker far. Chosen.
        acceptance: of accepted markers.
        hidden: of markers that dirt hides.
    """

    unexplained_noise_ratio: float = 3.0
    acceptance: AcceptanceLimits = LIMITS
    hidden: HiddenMarkerLimits = HIDDEN_MARKER_LIMITS


FINAL_LIMITS = FinalLimits()


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
    return FinalMarkers(*native.accept_markers(estimate, places, topology, FINAL_LIMITS))


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
    return np.asarray(
        native.update_lost_markers(xy, cov, unaccepted, predicted, start, edge, HIDDEN_MARKER_LIMITS)
    )
