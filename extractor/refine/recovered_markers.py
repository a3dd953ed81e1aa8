"""What synthesis has lost, as under dirt and glare, is measured by profiles: around the lost markers, and there alone.

The gridlines at the lost markers are read, judged and solved for these, between others that are held; what these cost
is all that the round costs. Some gridlines elsewhere show how well the pattern is explained where nothing is wrong.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.refine.acceptance import accepted_markers, update_obstructed_markers
from extractor.refine.estimate import EdgeContrasts, Estimate
from extractor.refine.measure.gridline_bending import bending_gridlines
from extractor.refine.measure.gridline_weights import (
    PRIOR_HIDDEN_PX,
    gridline_misfits,
    median_of_misfits,
    misfit_weights,
    well_weighted_markers,
)
from extractor.refine.measure.matched_filter import SQUARED_CONTRAST, read_profiles
from extractor.refine.profile_rounds import MISFIT_TOLERANCE, SAMPLE_MISFIT_RULE
from extractor.refine.refinement_step import PRIOR_PX, update_for_bending
from extractor.refine.solve.fisher_information import (
    HELD_INFORMATION,
    fill_information,
    gradient,
    solve_shifts,
)
from extractor.refine.solve.subproblem import gridlines_at, number_subproblem, selected_rows
from extractor.refine.synthesis.dot_gain import update_without_dot_gain
from extractor.refine.synthesis.gridlines import KNOWN, gridlines
from extractor.refine.synthesis.residual_kernel import A, B

STATIONS = 16  # a gridline
REFERENCE_INTERVAL = 12  # one of so many other gridlines is read,
MIN_REFERENCE_GRIDLINES = 20  # and so many of them tell what is usual; without them, all together do


def fill_recovered_markers(
    view: PyramidLevel,
    mesh: Topology,
    fit: Estimate,
    across: EdgeContrasts,
    places: InitialMarkers,
    lost: NDArray[np.bool_],
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
) -> None:
    """Fill in markers (M, 2) and covariances (M, 2, 2) of those ``lost`` (M,) whose gridlines look as they should; NaN
    where these are not sure, or far from the ``places`` (in the view). The ``fit`` is placed there."""
    assert fit.reading is not None
    look = fit.sigma, fit.noise, fit.dot_gain
    pattern = fit.xy, fit.beyond, fit.maps, fit.roughness, fit.bend, fit.reading.weight, look
    start = places.xy_px, places.edge_px, places.is_intact
    tables = mesh.edges, mesh.spokes, mesh.edge_vectors, mesh.edge_cells
    _fill_recovered_markers(view.image, pattern, tuple(across), start, tables, lost, xy, cov)


@compiled
def _fill_recovered_markers(image, pattern, across, start, tables, lost, xy, cov):  # type: ignore[no-untyped-def]
    at, beyond, _, _, _, _, (sigma, noise, _) = pattern
    edges, spokes, _, _ = tables
    which, count = _lost_and_reference_gridlines(lost, edges)
    lines, sums, to_a, to_b, use, loose = _weighed_profiles(image, pattern, across, tables, which, count)
    which, use, loose = which[:count], use[:count], loose[:count]
    markers, ends, turned = number_subproblem(which, edges, spokes)
    asked = lost[markers] & well_weighted_markers(use, turned)
    if not np.any(asked):
        return
    believed, variance = use * lines[:count, KNOWN], noise**2
    prior = np.where(beyond[markers], PRIOR_HIDDEN_PX**-2, PRIOR_PX**-2)
    prior[~beyond[markers] & np.isfinite(xy[markers, 0])] = HELD_INFORMATION
    diagonal, joined = np.empty((len(markers), 3)), np.empty((count, 4))
    geometry = lines[:count], selected_rows(across[0], which), ends, turned, sigma, variance, prior
    fill_information(sums[:count], believed, False, *geometry, diagonal, joined)
    right = gradient(to_a[:count], to_b[:count], believed, variance, lines[:count], ends, len(markers))
    measured = selected_rows(at, markers) + solve_shifts(diagonal, joined, ends, right)
    near = selected_rows(start[0], markers), start[1][markers], start[2][markers]
    own, wide = accepted_markers(measured, diagonal, joined, loose, ends, turned, *near, asked)
    update_obstructed_markers(own, wide, asked, *near)
    for k in np.flatnonzero(asked):
        xy[markers[k]], cov[markers[k]] = own[k], wide[k]


@compiled
def _lost_and_reference_gridlines(lost, edges):  # type: ignore[no-untyped-def]
    """The gridlines at the lost markers, then some of the others; and how many come first."""
    own, others = gridlines_at(lost, edges), np.arange(0, len(edges), REFERENCE_INTERVAL)
    elsewhere = ~(lost[edges[others, 0]] | lost[edges[others, 1]])
    return np.concatenate((own, others[elsewhere])), len(own)


@compiled
def _weighed_profiles(image, pattern, across, tables, which, count):  # type: ignore[no-untyped-def]
    """Of the gridlines ``gridlines`` (n,): how they run, what was read across them, their votes, how far they look
    as they
    should, and how freely they bend. All after the first ``count`` lie elsewhere."""
    at, _, maps, rough, bend, before, (sigma, noise, swelling) = pattern
    edges, _, along, edge_cells = tables
    values, least, unjudged = SAMPLE_MISFIT_RULE
    ends, bend, room = (
        selected_rows(edges, which),
        selected_rows(bend, which),
        selected_rows(across[2], which),
    )
    lines = gridlines(at, maps, bend, ends, selected_rows(along, which))
    weights, bending = selected_rows(across[1], which), bending_gridlines(rough, bend, ends)
    sums = read_profiles(image, lines, weights, room, sigma, bending, STATIONS)
    to_a, to_b, off = sums[:, A].copy(), sums[:, B].copy(), np.zeros(len(which))
    update_without_dot_gain(
        sums, to_a, to_b, selected_rows(across[0], which), selected_rows(edge_cells, which), swelling
    )
    said = bend, rough, before[which], lines, ends, noise
    loose, _ = update_for_bending(sums, to_a, to_b, off, *said, values, least, unjudged)
    misfit = gridline_misfits(sums, to_a, to_b, values, least)
    usual = median_of_misfits(misfit[count:] if len(which) - count >= MIN_REFERENCE_GRIDLINES else misfit)
    use = misfit_weights(
        sums, misfit, usual, MISFIT_TOLERANCE**2 * room[:, SQUARED_CONTRAST], values, unjudged
    )
    return lines, sums, to_a, to_b, use, loose
