"""The final tests of markers, and the treatment of those that are covered."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import markers as native
from extractor.numbering.marker_places import MAX_PLACE_ERROR, InitialMarkers
from extractor.refine.measure.gridline_bending import LIMITS as BENDING_LIMITS
from extractor.refine.refinement_step import PRIOR_PX
from extractor.refine.solve.fisher_information import LIMITS as INFORMATION_LIMITS
from extractor.refine.solve.fisher_information import Information, InformationLimits


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


def accepted_markers(
    measured: NDArray[np.float64],
    information: Information,
    bend_variance: NDArray[np.float64],
    edges: NDArray[np.int32],
    spokes: NDArray[np.int32],
    places: InitialMarkers,
    selected: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The markers that lie near their start place with a small deviation.

    Args:
        measured: (M, 2) px.
        information: about them.
        bend_variance: (E,) px^2.
        edges, spokes: (E, 2) and (M, 6).
        places: before refinement.
        selected: (M,) bool, the markers to test; no other is accepted.

    Returns:
        (M, 2) px and (M, 2, 2) px^2: markers and covariances, NaN where not accepted.
    """
    gridlines = bend_variance, edges, spokes
    xy, cov = native.accepted_markers(measured, information, *gridlines, places, selected, LIMITS)
    return xy, cov


def add_dirt_variance(
    cov: NDArray[np.float64],
    weight: NDArray[np.float64],
    spokes: NDArray[np.int32],
    edge: NDArray[np.float64],
) -> None:
    """Add the variance by dirt to the covariances: dirt on some gridlines moves the others, too.

    Args:
        cov: (M, 2, 2) px^2, written.
        weight: (E,) 0 to 1, of the gridlines; 0 for gridlines that were not measured.
        spokes: (M, 6) the gridlines at each marker.
        edge: (M,) px, the length of the edges at each marker.
    """
    native.add_dirt_variance(cov, weight, spokes, edge, HIDDEN_MARKER_LIMITS)


def update_unaccepted_markers(
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
    reliable: NDArray[np.float64],
    start: NDArray[np.float64],
    edge: NDArray[np.float64],
    unexplained: bool,
    dot_gain: float,
) -> tuple[NDArray[np.bool_], bool]:
    """The markers that are neither accepted nor reliable.

    Args:
        xy, cov: (M, 2) px and (M, 2, 2) px^2, NaN where not accepted. Where all is ``unexplained``, markers far from
            their start become NaN.
        reliable: (M, 2) px, NaN where the image shows a marker little.
        start, edge: (M, 2) px, (M,) px, as in ``InitialMarkers``.
        unexplained: the drawing does not explain the image.
        dot_gain: px.

    Returns:
        (M,) bool, the markers with a start that are not accepted or not reliable; and whether there are any.
    """
    markers, places = (xy, cov, reliable), (start, edge)
    out = native.update_unaccepted_markers(*markers, *places, unexplained, dot_gain, HIDDEN_MARKER_LIMITS)
    return out, bool(out.any())


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
