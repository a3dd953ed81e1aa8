"""A round of profiles: they are read, judged and solved.

One compiled function from the gridlines to the markers: between small ones, each array would be handed to Python and
back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import EdgeContrasts, Estimate
from extractor.refine.measure.gridline_bending import bending_gridlines
from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.measure.gridline_weights import ShiftGradients, weigh_gridlines
from extractor.refine.measure.matched_filter import read_profiles
from extractor.refine.outliers import suspect_markers
from extractor.refine.refinement_step import MisfitRule, solve_step, update_for_bending, with_solution
from extractor.refine.solve.convergence import groups_with_any
from extractor.refine.synthesis.dot_gain import measure_dot_gain, update_without_dot_gain
from extractor.refine.synthesis.residual_kernel import AA, A, B

SAMPLE_MISFIT_RULE = MisfitRule(1, 4, 1.0)
MISFIT_TOLERANCE = 0.1  # of the contrast: what glare and uneven light do to a profile
SQUARED_CONTRAST = 3  # of a gridline's room


def profile_step(
    view: PyramidLevel,
    mesh: Topology,
    fit: Estimate,
    lines: NDArray[np.float64],
    across: EdgeContrasts,
    stations: int,
    *,
    judged: bool,
) -> tuple[Estimate, NDArray[np.float64]]:
    """The fit after a round of profiles across its gridlines, and (E,) how far these look as they should.

    They are ``judged`` by it in the last round, where they are already close; before, the best look wrong, and it
    counts only around markers where little else is seen.
    """
    before = np.ones(len(lines)) if fit.reading is None else fit.reading.weight
    now = fit.xy, fit.beyond, fit.roughness, fit.bend, before, fit.sigma, fit.noise
    tables = mesh.edges, mesh.spokes, mesh.edge_cells
    read, *step = _profile_step(view.image, lines, tuple(across), now, tables, stations, judged)
    trusted, use, loose, swelling, aside = read
    foot = across.weights[:, 3].copy()
    reading = GridlineReading(
        lines, across.contrasts, foot, across.clearance, use, aside, fit.sigma, fit.noise, False
    )
    return with_solution(fit, step, bend_variance=loose, dot_gain=swelling, reading=reading), trusted


@compiled
def _profile_step(image, lines, across, now, tables, most, judged):  # type: ignore[no-untyped-def]
    """(E,) how far gridlines look as they should, how far they are used, and how freely they bend; by how much cells
    are swollen, and (E,) gridlines aside for it; and the solution."""
    contrasts, weights, room = across
    xy, beyond, rough, bend, before, sigma, noise = now
    edges, spokes, edge_cells = tables
    values, least, unjudged = SAMPLE_MISFIT_RULE
    sums = read_profiles(image, lines, weights, room, sigma, bending_gridlines(rough, bend, edges), most)
    gradients = ShiftGradients(sums[:, A].copy(), sums[:, B].copy(), np.zeros(len(sums)))
    swelling = measure_dot_gain(sums, gradients, contrasts, edge_cells, sigma)
    aside = update_without_dot_gain(sums, gradients, contrasts, edge_cells, swelling)
    bending = bend, rough, before, lines, edges, noise
    loose, kept = update_for_bending(sums, gradients, *bending, values, least, unjudged)
    trusted, _, _ = weigh_gridlines(
        sums, gradients, MISFIT_TOLERANCE**2 * room[:, SQUARED_CONTRAST], values, least, unjudged
    )
    use = trusted if judged else _lenient_weights(trusted, sums, edges, spokes)
    where = xy, beyond, edges, spokes, sigma, noise, False
    read = trusted, use, loose, swelling, aside
    return (read,) + solve_step(sums, gradients, bend, kept, use, lines, contrasts, *where)


@compiled
def _lenient_weights(trusted, sums, edges, spokes):  # type: ignore[no-untyped-def]
    """(E,) how far gridlines are used that are judged only around markers where little else is seen."""
    read = sums[:, AA] > 0.0
    doubted, _ = suspect_markers(trusted, read, spokes)
    return np.where(groups_with_any(doubted, edges), trusted, np.where(read, 1.0, 0.0))
