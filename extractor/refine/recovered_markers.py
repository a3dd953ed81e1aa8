"""What synthesis has lost, as under dirt and glare, is measured by profiles: around the lost markers, and there alone.

The gridlines at the lost markers are read, judged and solved for these, between others that are held; what these cost
is all that the round costs. Some gridlines elsewhere show how well the pattern is explained where nothing is wrong.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Sight
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import Places
from extractor.numeric.compilation import compiled
from extractor.refine.acceptance import doubt, sure_ones
from extractor.refine.estimate import Across, Fit
from extractor.refine.measure.gridline_bending import bending_ones
from extractor.refine.measure.gridline_weights import (
    PRIOR_BEYOND_PX,
    misfits,
    trusted_markers,
    usual_misfit,
    weighed,
)
from extractor.refine.measure.matched_filter import STRENGTH, read_profiles
from extractor.refine.profile_rounds import JUDGED_BY_SAMPLES, PARDON
from extractor.refine.refinement_step import PRIOR_PX, listened
from extractor.refine.solve.fisher_information import HELD, assemble, gradient, solve
from extractor.refine.solve.subproblem import alone, gridlines_at, rows_of
from extractor.refine.synthesis.dot_gain import unswollen
from extractor.refine.synthesis.gridlines import KNOWN, gridlines
from extractor.refine.synthesis.residual_kernel import A, B

STATIONS = 16  # a gridline
ELSEWHERE = 12  # one of so many other gridlines is read,
ENOUGH = 20  # and so many of them tell what is usual; without them, all together do


def regain(
    view: Sight,
    mesh: Topology,
    fit: Fit,
    across: Across,
    places: Places,
    lost: NDArray[np.bool_],
    xy: NDArray[np.float64],
    cov: NDArray[np.float64],
) -> None:
    """Fill in markers (M, 2) and covariances (M, 2, 2) of those ``lost`` (M,) whose gridlines look as they should; NaN
    where these are not sure, or far from the ``places`` (in the view). The ``fit`` is placed there."""
    assert fit.reading is not None
    look = fit.sigma, fit.noise, fit.swelling
    pattern = fit.xy, fit.beyond, fit.maps, fit.rough, fit.bend, fit.reading.use, look
    start = places.xy_px, places.edge_px, places.whole
    tables = mesh.edges, mesh.spokes, mesh.along, mesh.edge_cells
    _regain(view.image, pattern, tuple(across), start, tables, lost, xy, cov)


@compiled
def _regain(image, pattern, across, start, tables, lost, xy, cov):  # type: ignore[no-untyped-def]
    at, beyond, _, _, _, _, (sigma, noise, _) = pattern
    edges, spokes, _, _ = tables
    which, count = _gridlines_around(lost, edges)
    lines, sums, to_a, to_b, use, loose = _read(image, pattern, across, tables, which, count)
    which, use, loose = which[:count], use[:count], loose[:count]
    markers, ends, turned = alone(which, edges, spokes)
    asked = lost[markers] & trusted_markers(use, turned)
    if not np.any(asked):
        return
    believed, variance = use * lines[:count, KNOWN], noise**2
    prior = np.where(beyond[markers], PRIOR_BEYOND_PX**-2, PRIOR_PX**-2)
    prior[~beyond[markers] & np.isfinite(xy[markers, 0])] = HELD
    diagonal, joined = np.empty((len(markers), 3)), np.empty((count, 4))
    geometry = lines[:count], rows_of(across[0], which), ends, turned, sigma, variance, prior
    assemble(sums[:count], believed, False, *geometry, diagonal, joined)
    right = gradient(to_a[:count], to_b[:count], believed, variance, lines[:count], ends, len(markers))
    measured = rows_of(at, markers) + solve(diagonal, joined, ends, right)
    near = rows_of(start[0], markers), start[1][markers], start[2][markers]
    own, wide = sure_ones(measured, diagonal, joined, loose, ends, turned, *near, asked)
    doubt(own, wide, asked, *near)
    for k in np.flatnonzero(asked):
        xy[markers[k]], cov[markers[k]] = own[k], wide[k]


@compiled
def _gridlines_around(lost, edges):  # type: ignore[no-untyped-def]
    """The gridlines at the lost markers, then some of the others; and how many come first."""
    own, others = gridlines_at(lost, edges), np.arange(0, len(edges), ELSEWHERE)
    elsewhere = ~(lost[edges[others, 0]] | lost[edges[others, 1]])
    return np.concatenate((own, others[elsewhere])), len(own)


@compiled
def _read(image, pattern, across, tables, which, count):  # type: ignore[no-untyped-def]
    """Of the gridlines ``which`` (n,): how they run, what was read across them, their votes, how far they look as they
    should, and how freely they bend. All after the first ``count`` lie elsewhere."""
    at, _, maps, rough, bend, before, (sigma, noise, swelling) = pattern
    edges, _, along, edge_cells = tables
    values, least, unjudged = JUDGED_BY_SAMPLES
    ends, bend, room = rows_of(edges, which), rows_of(bend, which), rows_of(across[2], which)
    lines = gridlines(at, maps, bend, ends, rows_of(along, which))
    weights, bending = rows_of(across[1], which), bending_ones(rough, bend, ends)
    sums = read_profiles(image, lines, weights, room, sigma, bending, STATIONS)
    to_a, to_b, off = sums[:, A].copy(), sums[:, B].copy(), np.zeros(len(which))
    unswollen(sums, to_a, to_b, rows_of(across[0], which), rows_of(edge_cells, which), swelling)
    said = bend, rough, before[which], lines, ends, noise
    loose, _ = listened(sums, to_a, to_b, off, *said, values, least, unjudged)
    misfit = misfits(sums, to_a, to_b, values, least)
    usual = usual_misfit(misfit[count:] if len(which) - count >= ENOUGH else misfit)
    use = weighed(sums, misfit, usual, PARDON**2 * room[:, STRENGTH], values, unjudged)
    return lines, sums, to_a, to_b, use, loose
