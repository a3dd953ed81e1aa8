"""A step by synthesis around some markers: what is drawn anew there is read, judged and solved, and nothing else.

The markers that are drawn anew are solved together with those beside them, between others that are held where the last
step left them. Levels, blur, noise, swelling and what misfit is usual are what the last step from everything said.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Sight
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.drawn_pattern import Board, Drawing, chosen, look_of, redrawn, replaced, sides_of
from extractor.refine.estimate import Fit
from extractor.refine.measure.gridline_bending import bent, eliminate, freedom, hidden_misfit, roughness
from extractor.refine.measure.gridline_offsets import foot_of
from extractor.refine.measure.gridline_weights import (
    PRIOR_BEYOND_PX,
    middles,
    misfits,
    strides,
    votes,
    weighed,
)
from extractor.refine.refinement_step import JUDGED_BY_PIXELS, PRIOR_PX, completed_around
from extractor.refine.solve.convergence import beside
from extractor.refine.solve.fisher_information import HELD, Information, assemble, gradient, multiply, solve
from extractor.refine.solve.subproblem import alone, gridlines_at, rows_of, with_rows
from extractor.refine.synthesis.dot_gain import unswollen
from extractor.refine.synthesis.gridlines import KNOWN


class Part(NamedTuple):
    """Some gridlines (n) and the markers at their ends (m), numbered among themselves.

    Attributes:
        which: (n,) the gridlines. markers: (m,) the markers.
        ends: (n, 2) the gridlines' ends. around: (m, 6) the gridlines around each marker, -1 for none.
        free: (m,) bool, all gridlines around it are there. beyond: (m,) bool. rough: (m,) px^2.
        away: (m, 2) px, how far each marker is from where it is drawn.
    """

    which: NDArray[np.int64]
    markers: NDArray[np.int64]
    ends: NDArray[np.int32]
    around: NDArray[np.int32]
    free: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    rough: NDArray[np.float64]
    away: NDArray[np.float64]


class Read(NamedTuple):
    """What was read along the gridlines of a part (n), and what follows.

    Attributes:
        lines, contrasts, sums, bend: as drawn and read, bending eliminated from the sums.
        to_a, to_b, off: the votes, and how the levels' change explains some.
        loose, kept: how freely they bend, and what their bending is.
        use: how far they are trusted. aside: px, as the cells are swollen.
    """

    lines: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    sums: NDArray[np.float64]
    to_a: NDArray[np.float64]
    to_b: NDArray[np.float64]
    off: NDArray[np.float64]
    bend: NDArray[np.float64]
    loose: NDArray[np.float64]
    kept: NDArray[np.float64]
    use: NDArray[np.float64]
    aside: NDArray[np.float64]


def stepped_around(
    view: Sight,
    mesh: Topology,
    fit: Fit,
    drawing: Drawing,
    anew: NDArray[np.bool_],
    board: Board,
    wide: bool,
) -> tuple[Fit, Drawing]:
    """The fit and the drawing after a step around the markers that are ``anew`` (M,) bool.

    ``wide``: no gridline may bend, as the blur is wide.
    """
    levels, bettered, reading = drawing.levels, drawing.bettered, fit.reading
    assert reading is not None
    tables = sides_of(mesh), (mesh.spokes, mesh.near, mesh.offset, mesh.stencil, mesh.ahead, mesh.third)
    look = look_of(view, levels, drawing.sigma, drawing.box)
    markers = fit.measured, fit.guiding, fit.maps, fit.rough, fit.strides, fit.information.diagonal
    gridlines = (
        fit.bend,
        fit.loose,
        fit.information.beside,
        reading.use,
        reading.foot,
        reading.aside,
    )
    changes = bettered.cell - levels.cell, bettered.black - levels.black
    said = fit.noise, fit.usual, fit.swelling, wide, changes
    given = view.image, tuple(board), anew, tables, look, tuple(drawing[:6])
    drew, markers, gridlines = _around(*given, markers, gridlines, said)
    xy, lines, drawn_bend, contrasts, black, sums = drew
    drawing = drawing._replace(
        xy=xy, lines=lines, bend=drawn_bend, contrasts=contrasts, black=black, sums=sums
    )
    measured, guiding, beyond, maps, rough, stepped, diagonal = markers
    where = {"xy": xy, "measured": measured, "guiding": guiding, "beyond": beyond, "maps": maps}
    bend, loose, joined, use, foot, aside = gridlines
    how = {"bend": bend, "loose": loose, "rough": rough, "strides": stepped}
    reading = reading._replace(lines=lines, contrasts=contrasts, foot=foot, use=use, aside=aside)
    return fit._replace(**where, **how, information=Information(diagonal, joined), reading=reading), drawing


@compiled
def _around(image, board, anew, tables, look, before, markers, gridlines, said):  # type: ignore[no-untyped-def]
    """The first six of a ``Drawing``; of the fit what belongs to markers, and what belongs to gridlines."""
    sides, (spokes, near, offset, stencil, ahead, third) = tables
    measured, guiding, maps, rough, stepped, known = markers
    edges, bend, wide = sides[2], gridlines[0], said[3]
    xy, beyond, maps = completed_around(guiding, anew, maps, near, offset, stencil)
    free = anew.copy()
    beside(anew, edges, free)
    if not wide:
        about = edges, ahead, third, spokes, near
        rough = chosen(free, roughness(guiding, maps, known, *about, free), rough)
    drew = redrawn(image, board, (xy, maps, bend, rough), sides, look, anew, before)
    part = _part(free, beyond, rough, _away(measured, before[0], anew), edges, spokes)
    read = _read(drew, part, sides[3], gridlines, look, said)
    away, diagonal, joined = _solved(part, read, gridlines[2], look[3], said[0])
    where = _moved(drew[0], away, diagonal, part, measured, guiding, stepped, known)
    measured, guiding, stepped, known = where
    lines = _told(drew, away, joined, part, read, gridlines)
    return drew, (measured, guiding, beyond, maps, rough, stepped, known), lines


@compiled
def _away(measured, drawn, anew):  # type: ignore[no-untyped-def]
    """(M, 2) px, how far the markers are from where they are drawn, 0 for those drawn ``anew`` and unknown ones."""
    out = measured - drawn
    for m in range(out.shape[0]):
        if anew[m] or not np.isfinite(out[m, 0]):
            out[m, 0], out[m, 1] = 0.0, 0.0
    return out


@compiled
def _part(free, beyond, rough, away, edges, spokes):  # type: ignore[no-untyped-def]
    """The part of the pattern at ``free`` markers."""
    which = gridlines_at(free, edges)
    markers, ends, around = alone(which, edges, spokes)
    kinds = free[markers], beyond[markers], rough[markers]
    return Part(which, markers, ends, around, *kinds, rows_of(away, markers))


@compiled
def _read(drew, part, edge_cells, gridlines, look, said):  # type: ignore[no-untyped-def]
    """What was read along the gridlines of a part, judged as all of them were."""
    use = gridlines[3]
    _, lines, bend, contrasts, _, sums = drew
    noise, usual, swelling, _, changes = said
    values, least, unjudged = JUDGED_BY_PIXELS
    which, frame, sigma, variance = part.which, look[2], look[3], noise**2
    sums, lines, contrasts = rows_of(sums, which), rows_of(lines, which), rows_of(contrasts, which)
    cells, bend = rows_of(edge_cells, which), rows_of(bend, which)
    to_a, to_b, off = votes(sums, contrasts, cells, changes[0], changes[1], middles(lines), *frame)
    aside = unswollen(sums, to_a, to_b, contrasts, cells, swelling)
    loose = np.zeros(len(which))
    if np.any(part.rough) or np.any(bend):
        about = use[which], lines, part.ends, variance
        loose = freedom(sums, to_a, to_b, off, bend, part.rough, *about)
    kept = eliminate(sums, to_a, to_b, off, bend, loose, variance)
    misfit, pardon = misfits(sums, to_a, to_b, values, least), hidden_misfit(loose, contrasts, sigma)
    trusted = weighed(sums, misfit, usual, pardon, values, unjudged)
    return Read(lines, contrasts, sums, to_a, to_b, off, bend, loose, kept, trusted, aside)


@compiled
def _solved(part, read, joined, sigma, noise):  # type: ignore[no-untyped-def]
    """How far the markers of a part are from where they are drawn, and the information's blocks; ``joined`` are those
    of all gridlines as they were."""
    believed, variance = read.use * read.lines[:, KNOWN], noise**2
    prior = np.where(part.beyond, PRIOR_BEYOND_PX**-2, PRIOR_PX**-2)
    diagonal, own = np.empty((len(part.markers), 3)), np.empty((len(part.which), 4))
    geometry = read.lines, read.contrasts, part.ends, part.around, sigma, variance, prior
    assemble(read.sums, believed, True, *geometry, diagonal, own)
    for k in range(len(own)):
        if not (part.free[part.ends[k, 0]] and part.free[part.ends[k, 1]]):
            # not all gridlines at the other end are read, which share pixels with this one
            own[k] = joined[part.which[k]]
    right = gradient(read.to_a, read.to_b, believed, variance, read.lines, part.ends, len(diagonal))
    explained = np.empty_like(part.away)
    multiply(diagonal, own, part.ends, part.away, explained)
    known = diagonal.copy()
    for k in range(len(known)):
        for axis in range(2):
            right[k, axis] = right[k, axis] - explained[k, axis] if part.free[k] else 0.0
        if not part.free[k]:
            known[k, 0], known[k, 1], known[k, 2] = HELD, 0.0, HELD
    return part.away + solve(known, own, part.ends, right), diagonal, own


@compiled
def _moved(xy, away, diagonal, part, measured, guiding, stepped, known):  # type: ignore[no-untyped-def]
    """Of all markers, the free ones of the part as they were solved: measured, guiding, strides, and what is known."""
    far = strides(away, diagonal, part.beyond)
    measured, guiding, stepped, known = measured.copy(), guiding.copy(), stepped.copy(), known.copy()
    for k in np.flatnonzero(part.free):
        m = part.markers[k]
        for axis in range(2):
            measured[m, axis] = xy[m, axis] + away[k, axis]
            guiding[m, axis] = measured[m, axis] if np.isfinite(guiding[m, axis]) else np.nan
        stepped[m], known[m] = far[k], diagonal[k]
    return measured, guiding, stepped, known


@compiled
def _told(drew, away, own, part, read, gridlines):  # type: ignore[no-untyped-def]
    """Of all gridlines, those of the part as they were read: bending, how freely, information beside, use, foot and how
    far aside."""
    which, (bend, loose, joined, use, foot, aside) = part.which, gridlines
    own_bend = bent(read.bend, read.kept, away, read.lines, part.ends)
    own_foot = foot_of(read.contrasts, rows_of(drew[4], which), read.off)
    bend, joined = with_rows(bend, which, own_bend), with_rows(joined, which, own)
    loose, use = replaced(loose, which, read.loose), replaced(use, which, read.use)
    foot, aside = replaced(foot, which, own_foot), replaced(aside, which, read.aside)
    return bend, loose, joined, use, foot, aside
