"""Markers that synthesis has lost, as under dirt and glare, are measured by profiles.

The gridlines at the lost markers are read, weighed and solved for these, between other markers that are held, so that
the round costs as much as these gridlines. Some gridlines elsewhere show the usual misfit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.refine.acceptance import accepted_markers, update_obstructed_markers
from extractor.refine.estimate import EdgeContrasts, Estimate, StartPlaces, start_places
from extractor.refine.measure.gridline_bending import bending_gridlines
from extractor.refine.measure.gridline_weights import (
    ShiftGradients,
    gridline_misfits,
    median_of_misfits,
    misfit_weights,
    well_weighted_markers,
)
from extractor.refine.measure.matched_filter import SQUARED_CONTRAST, read_profiles
from extractor.refine.profile_rounds import MISFIT_TOLERANCE, SAMPLE_MISFIT_RULE
from extractor.refine.refinement_step import (
    BendingPrior,
    prior_information,
    update_for_bending,
)
from extractor.refine.solve.fisher_information import (
    HELD_INFORMATION,
    GridlineSystem,
    fisher_information,
    gradient,
    solve_shifts,
)
from extractor.refine.solve.subproblem import gridlines_at, number_subproblem, selected_rows
from extractor.refine.synthesis.dot_gain import update_without_dot_gain
from extractor.refine.synthesis.gridlines import gridlines
from extractor.refine.synthesis.residual_kernel import A, B

STATIONS = 16  # a gridline
REFERENCE_INTERVAL = 12  # one of so many other gridlines is read
MIN_REFERENCE_GRIDLINES = 20  # other gridlines for the usual misfit; with fewer, all together give it


class WeighedProfiles(NamedTuple):
    """Profiles across n gridlines.

    Attributes:
        lines: (n, 8).
        sums: (n, 24), bending and dot gain eliminated.
        gradients: likewise.
        weight: (n,) 0 to 1, how well each gridline looks like the pattern.
        bend_variance: (n,) px^2.
    """

    lines: NDArray[np.float64]
    sums: NDArray[np.float64]
    gradients: ShiftGradients
    weight: NDArray[np.float64]
    bend_variance: NDArray[np.float64]


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
        estimate: with its pattern where the last step left the markers.
        contrasts: across its gridlines.
        places: before refinement, in the view.
        lost: (M,) bool.
        xy, cov: (M, 2) px and (M, 2, 2) px^2, written; NaN where a lost marker is not accepted, or far from its place.
    """
    state, start = estimate.pattern_state(), start_places(places)
    _fill_recovered_markers(view, state, contrasts, start, topology, lost, xy, cov)


@compiled
def _fill_recovered_markers(view, state, contrasts, places, topology, lost, xy, cov):  # type: ignore[no-untyped-def]
    edges, spokes, hidden = topology.edges, topology.spokes, state.hidden
    gridline_ids, count = _lost_and_reference_gridlines(lost, edges)
    read = _weighed_profiles(view, state, contrasts, topology, gridline_ids, count)
    gridline_ids, weight, bend_variance = (
        gridline_ids[:count],
        read.weight[:count],
        read.bend_variance[:count],
    )
    markers, ends, around = number_subproblem(gridline_ids, edges, spokes)
    asked = lost[markers] & well_weighted_markers(weight, around)
    if not np.any(asked):
        return
    prior = prior_information(hidden[markers])
    prior[~hidden[markers] & np.isfinite(xy[markers, 0])] = HELD_INFORMATION
    across, lines = selected_rows(contrasts.contrasts, gridline_ids), read.lines[:count]
    system = GridlineSystem(
        read.sums[:count], weight, lines, across, ends, around, state.sigma, state.noise**2
    )
    information = fisher_information(system, prior, False)
    right = gradient(system, read.gradients.start[:count], read.gradients.end[:count])
    shift = solve_shifts(information.diagonal, information.off_diagonal, ends, right)
    measured = selected_rows(state.xy, markers) + shift
    own = StartPlaces(
        selected_rows(places.xy_px, markers),
        places.edge_px[markers],
        places.agreed[markers],
        places.is_intact[markers],
    )
    new_xy, new_cov = accepted_markers(measured, information, bend_variance, ends, around, own, asked)
    update_obstructed_markers(new_xy, new_cov, asked, own)
    for k in np.flatnonzero(asked):
        xy[markers[k]], cov[markers[k]] = new_xy[k], new_cov[k]


@compiled
def _lost_and_reference_gridlines(lost, edges):  # type: ignore[no-untyped-def]
    """(n,) the gridlines at the lost markers (M,) bool, then some of the others; and the count of the former."""
    own, others = gridlines_at(lost, edges), np.arange(0, len(edges), REFERENCE_INTERVAL)
    elsewhere = ~(lost[edges[others, 0]] | lost[edges[others, 1]])
    return np.concatenate((own, others[elsewhere])), len(own)


@compiled
def _weighed_profiles(view, state, contrasts, topology, gridline_ids, count):  # type: ignore[no-untyped-def]
    """``WeighedProfiles`` of the gridlines (n,); those after the first ``count`` show the usual misfit."""
    sigma, rule = state.sigma, SAMPLE_MISFIT_RULE
    ends, bend = selected_rows(topology.edges, gridline_ids), selected_rows(state.bend, gridline_ids)
    across = EdgeContrasts(
        selected_rows(contrasts.sides, gridline_ids),
        selected_rows(contrasts.contrasts, gridline_ids),
        selected_rows(contrasts.clearance, gridline_ids),
    )
    lines = gridlines(state.xy, state.maps, bend, ends, selected_rows(topology.edge_vectors, gridline_ids))
    bending = bending_gridlines(state.roughness, bend, ends)
    sums = read_profiles(view, lines, across, sigma, bending, STATIONS)
    gradients = ShiftGradients(sums[:, A].copy(), sums[:, B].copy())
    cells = selected_rows(topology.edge_cells, gridline_ids)
    update_without_dot_gain(sums, gradients, across.contrasts, cells, state.dot_gain)
    prior = BendingPrior(bend, state.roughness, state.weight[gridline_ids])
    bend_variance, _ = update_for_bending(sums, gradients, prior, lines, ends, state.noise, rule)
    misfit = gridline_misfits(sums, gradients, rule.values, rule.min_places)
    median = median_of_misfits(
        misfit[count:] if len(gridline_ids) - count >= MIN_REFERENCE_GRIDLINES else misfit
    )
    pardon = MISFIT_TOLERANCE**2 * across.clearance[:, SQUARED_CONTRAST]
    weight = misfit_weights(sums, misfit, median, pardon, rule.values, rule.default_weight)
    return WeighedProfiles(lines, sums, gradients, weight, bend_variance)
