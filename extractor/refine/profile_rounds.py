"""A round of profiles: they are read, judged and solved.

One compiled function from the gridlines to the markers: between small ones, each array would be handed to Python and
back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Sight
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Across, Fit
from extractor.refine.measure.gridline_bending import bending_ones
from extractor.refine.measure.gridline_offsets import Reading
from extractor.refine.measure.gridline_weights import trust
from extractor.refine.measure.matched_filter import read_profiles
from extractor.refine.outliers import doubted_ones
from extractor.refine.refinement_step import Judged, listened, moved_on, solution
from extractor.refine.solve.convergence import touching
from extractor.refine.synthesis.dot_gain import swelling_of, unswollen
from extractor.refine.synthesis.residual_kernel import AA, A, B

JUDGED_BY_SAMPLES = Judged(1, 4, 1.0)
PARDON = 0.1  # of the contrast: what glare and uneven light do to a profile
STRENGTH = 3  # of a gridline's room


def profiled(
    view: Sight,
    mesh: Topology,
    fit: Fit,
    lines: NDArray[np.float64],
    across: Across,
    stations: int,
    *,
    judged: bool,
) -> tuple[Fit, NDArray[np.float64]]:
    """The fit after a round of profiles across its gridlines, and (E,) how far these look as they should.

    They are ``judged`` by it in the last round, where they are already close; before, the best look wrong, and it
    counts only around markers where little else is seen.
    """
    before = np.ones(len(lines)) if fit.reading is None else fit.reading.use
    now = fit.xy, fit.beyond, fit.rough, fit.bend, before, fit.sigma, fit.noise
    tables = mesh.edges, mesh.spokes, mesh.edge_cells
    read, *step = _profiled(view.image, lines, tuple(across), now, tables, stations, judged)
    trusted, use, loose, swelling, aside = read
    foot = across.weights[:, 3].copy()
    reading = Reading(lines, across.contrasts, foot, across.room, use, aside, fit.sigma, fit.noise, False)
    return moved_on(fit, step, loose=loose, swelling=swelling, reading=reading), trusted


@compiled
def _profiled(image, lines, across, now, tables, most, judged):  # type: ignore[no-untyped-def]
    """(E,) how far gridlines look as they should, how far they are used, and how freely they bend; by how much cells
    are swollen, and (E,) gridlines aside for it; and the solution."""
    contrasts, weights, room = across
    xy, beyond, rough, bend, before, sigma, noise = now
    edges, spokes, edge_cells = tables
    values, least, unjudged = JUDGED_BY_SAMPLES
    sums = read_profiles(image, lines, weights, room, sigma, bending_ones(rough, bend, edges), most)
    to_a, to_b, off = sums[:, A].copy(), sums[:, B].copy(), np.zeros(len(sums))
    swelling = swelling_of(sums, to_a, to_b, contrasts, edge_cells, sigma)
    aside = unswollen(sums, to_a, to_b, contrasts, edge_cells, swelling)
    bending = bend, rough, before, lines, edges, noise
    loose, kept = listened(sums, to_a, to_b, off, *bending, values, least, unjudged)
    trusted, _, _ = trust(sums, to_a, to_b, PARDON**2 * room[:, STRENGTH], values, least, unjudged)
    use = trusted if judged else _lenient(trusted, sums, edges, spokes)
    where = xy, beyond, edges, spokes, sigma, noise, False
    read = trusted, use, loose, swelling, aside
    return (read,) + solution(sums, to_a, to_b, bend, kept, use, lines, contrasts, *where)


@compiled
def _lenient(trusted, sums, edges, spokes):  # type: ignore[no-untyped-def]
    """(E,) how far gridlines are used that are judged only around markers where little else is seen."""
    read = sums[:, AA] > 0.0
    doubted, _ = doubted_ones(trusted, read, spokes)
    return np.where(touching(doubted, edges), trusted, np.where(read, 1.0, 0.0))
