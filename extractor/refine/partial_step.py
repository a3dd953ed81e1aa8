"""A step by synthesis around some markers: what is drawn anew there is read, judged and solved, and nothing else.

The markers that are drawn anew are solved together with those beside them, between others that are held where the last
step left them. Levels, blur, noise, swelling and what misfit is usual are what the last step from everything said.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.drawn_pattern import (
    DrawingBuffers,
    Synthesis,
    draw_pattern_part,
    merged_rows,
    packed_appearance,
    packed_topology,
    replaced_rows,
)
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import (
    bend_after_shift,
    bending_misfit,
    estimate_bend_variance,
    measure_roughness,
    update_without_bending,
)
from extractor.refine.measure.gridline_offsets import foot_levels
from extractor.refine.measure.gridline_weights import (
    PRIOR_HIDDEN_PX,
    chord_midpoints,
    gridline_misfits,
    misfit_weights,
    normalized_step_lengths,
    shift_gradients,
)
from extractor.refine.refinement_step import PIXEL_MISFIT_RULE, PRIOR_PX, extrapolate_pattern_around
from extractor.refine.solve.convergence import add_neighbours
from extractor.refine.solve.fisher_information import (
    HELD_INFORMATION,
    Information,
    fill_information,
    fill_product,
    gradient,
    solve_shifts,
)
from extractor.refine.solve.subproblem import (
    gridlines_at,
    number_subproblem,
    replaced_table_rows,
    selected_rows,
)
from extractor.refine.synthesis.dot_gain import update_without_dot_gain
from extractor.refine.synthesis.gridlines import KNOWN


class Subproblem(NamedTuple):
    """Some gridlines (n) and the markers at their ends (m), numbered among themselves.

    Attributes:
        which: (n,) the gridlines. markers: (m,) the markers.
        ends: (n, 2) the gridlines' ends. around: (m, 6) the gridlines around each marker, -1 for none.
        free: (m,) bool, all gridlines around it are there. beyond: (m,) bool. rough: (m,) px^2.
        away: (m, 2) px, how far each marker is from where it is drawn.
    """

    gridlines: NDArray[np.int64]
    markers: NDArray[np.int64]
    ends: NDArray[np.int32]
    spokes: NDArray[np.int32]
    free: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    roughness: NDArray[np.float64]
    shifts: NDArray[np.float64]


class SubproblemReading(NamedTuple):
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
    gradient_a: NDArray[np.float64]
    gradient_b: NDArray[np.float64]
    level_shift: NDArray[np.float64]
    bend: NDArray[np.float64]
    bend_variance: NDArray[np.float64]
    kept: NDArray[np.float64]
    weight: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]


def partial_step(
    view: PyramidLevel,
    mesh: Topology,
    fit: Estimate,
    drawing: Synthesis,
    anew: NDArray[np.bool_],
    board: DrawingBuffers,
    wide: bool,
) -> tuple[Estimate, Synthesis]:
    """The fit and the drawing after a step around the markers that are ``anew`` (M,) bool.

    ``wide``: no gridline may bend, as the blur is wide.
    """
    levels, bettered, reading = drawing.levels, drawing.corrected_levels, fit.reading
    assert reading is not None
    tables = (
        packed_topology(mesh),
        (
            mesh.spokes,
            mesh.ring_markers,
            mesh.ring_vectors,
            mesh.derivative_stencil,
            mesh.next_markers,
            mesh.third_differences,
        ),
    )
    look = packed_appearance(view, levels, drawing.sigma, drawing.box)
    markers = (
        fit.measured,
        fit.reliable,
        fit.maps,
        fit.roughness,
        fit.normalized_steps,
        fit.information.diagonal,
    )
    gridlines = (
        fit.bend,
        fit.bend_variance,
        fit.information.beside,
        reading.weight,
        reading.foot,
        reading.dot_gain_offset,
    )
    changes = bettered.cell - levels.cell, bettered.black - levels.black
    said = fit.noise, fit.median_misfit, fit.dot_gain, wide, changes
    given = view.image, tuple(board), anew, tables, look, tuple(drawing[:6])
    drew, markers, gridlines = _draw_and_solve_part(*given, markers, gridlines, said)
    xy, lines, drawn_bend, contrasts, black, sums = drew
    drawing = drawing._replace(
        xy=xy, lines=lines, bend=drawn_bend, contrasts=contrasts, black=black, sums=sums
    )
    measured, guiding, beyond, maps, rough, stepped, diagonal = markers
    where = {"xy": xy, "measured": measured, "reliable": guiding, "beyond": beyond, "maps": maps}
    bend, loose, joined, use, foot, aside = gridlines
    how = {"bend": bend, "bend_variance": loose, "roughness": rough, "normalized_steps": stepped}
    reading = reading._replace(lines=lines, contrasts=contrasts, foot=foot, weight=use, dot_gain_offset=aside)
    return fit._replace(**where, **how, information=Information(diagonal, joined), reading=reading), drawing


@compiled
def _draw_and_solve_part(image, board, anew, tables, look, before, markers, gridlines, said):  # type: ignore[no-untyped-def]
    """The first six of a ``Synthesis``; of the fit what belongs to markers, and what belongs to gridlines."""
    sides, (spokes, near, offset, stencil, ahead, third) = tables
    measured, guiding, maps, rough, stepped, known = markers
    edges, bend, wide = sides[2], gridlines[0], said[3]
    xy, beyond, maps = extrapolate_pattern_around(guiding, anew, maps, near, offset, stencil)
    free = anew.copy()
    add_neighbours(anew, edges, free)
    if not wide:
        about = edges, ahead, third, spokes, near
        rough = merged_rows(free, measure_roughness(guiding, maps, known, *about, free), rough)
    drew = draw_pattern_part(image, board, (xy, maps, bend, rough), sides, look, anew, before)
    part = _subproblem(free, beyond, rough, _held_shifts(measured, before[0], anew), edges, spokes)
    read = _subproblem_reading(drew, part, sides[3], gridlines, look, said)
    away, diagonal, joined = _solve_subproblem(part, read, gridlines[2], look[3], said[0])
    where = _markers_after_step(drew[0], away, diagonal, part, measured, guiding, stepped, known)
    measured, guiding, stepped, known = where
    lines = _gridlines_after_step(drew, away, joined, part, read, gridlines)
    return drew, (measured, guiding, beyond, maps, rough, stepped, known), lines


@compiled
def _held_shifts(measured, drawn, anew):  # type: ignore[no-untyped-def]
    """(M, 2) px, how far the markers are from where they are drawn, 0 for those drawn ``anew`` and unknown ones."""
    out = measured - drawn
    for m in range(out.shape[0]):
        if anew[m] or not np.isfinite(out[m, 0]):
            out[m, 0], out[m, 1] = 0.0, 0.0
    return out


@compiled
def _subproblem(free, beyond, rough, away, edges, spokes):  # type: ignore[no-untyped-def]
    """The part of the pattern at ``free`` markers."""
    which = gridlines_at(free, edges)
    markers, ends, around = number_subproblem(which, edges, spokes)
    kinds = free[markers], beyond[markers], rough[markers]
    return Subproblem(which, markers, ends, around, *kinds, selected_rows(away, markers))


@compiled
def _subproblem_reading(drew, part, edge_cells, gridlines, look, said):  # type: ignore[no-untyped-def]
    """What was read along the gridlines of a part, judged as all of them were."""
    use = gridlines[3]
    _, lines, bend, contrasts, _, sums = drew
    noise, usual, swelling, _, changes = said
    values, least, unjudged = PIXEL_MISFIT_RULE
    which, frame, sigma, variance = part.gridlines, look[2], look[3], noise**2
    sums, lines, contrasts = (
        selected_rows(sums, which),
        selected_rows(lines, which),
        selected_rows(contrasts, which),
    )
    cells, bend = selected_rows(edge_cells, which), selected_rows(bend, which)
    to_a, to_b, off = shift_gradients(
        sums, contrasts, cells, changes[0], changes[1], chord_midpoints(lines), *frame
    )
    aside = update_without_dot_gain(sums, to_a, to_b, contrasts, cells, swelling)
    loose = np.zeros(len(which))
    if np.any(part.roughness) or np.any(bend):
        about = use[which], lines, part.ends, variance
        loose = estimate_bend_variance(sums, to_a, to_b, off, bend, part.roughness, *about)
    kept = update_without_bending(sums, to_a, to_b, off, bend, loose, variance)
    misfit, pardon = (
        gridline_misfits(sums, to_a, to_b, values, least),
        bending_misfit(loose, contrasts, sigma),
    )
    trusted = misfit_weights(sums, misfit, usual, pardon, values, unjudged)
    return SubproblemReading(lines, contrasts, sums, to_a, to_b, off, bend, loose, kept, trusted, aside)


@compiled
def _solve_subproblem(part, read, joined, sigma, noise):  # type: ignore[no-untyped-def]
    """How far the markers of a part are from where they are drawn, and the information's blocks; ``joined`` are those
    of all gridlines as they were."""
    believed, variance = read.weight * read.lines[:, KNOWN], noise**2
    prior = np.where(part.beyond, PRIOR_HIDDEN_PX**-2, PRIOR_PX**-2)
    diagonal, own = np.empty((len(part.markers), 3)), np.empty((len(part.gridlines), 4))
    geometry = read.lines, read.contrasts, part.ends, part.spokes, sigma, variance, prior
    fill_information(read.sums, believed, True, *geometry, diagonal, own)
    for k in range(len(own)):
        if not (part.free[part.ends[k, 0]] and part.free[part.ends[k, 1]]):
            # not all gridlines at the other end are read, which share pixels with this one
            own[k] = joined[part.gridlines[k]]
    right = gradient(
        read.gradient_a, read.gradient_b, believed, variance, read.lines, part.ends, len(diagonal)
    )
    explained = np.empty_like(part.shifts)
    fill_product(diagonal, own, part.ends, part.shifts, explained)
    known = diagonal.copy()
    for k in range(len(known)):
        for axis in range(2):
            right[k, axis] = right[k, axis] - explained[k, axis] if part.free[k] else 0.0
        if not part.free[k]:
            known[k, 0], known[k, 1], known[k, 2] = HELD_INFORMATION, 0.0, HELD_INFORMATION
    return part.shifts + solve_shifts(known, own, part.ends, right), diagonal, own


@compiled
def _markers_after_step(xy, away, diagonal, part, measured, guiding, stepped, known):  # type: ignore[no-untyped-def]
    """Of all markers, the free ones of the part as they were solved: measured, guiding, strides, and what is known."""
    far = normalized_step_lengths(away, diagonal, part.beyond)
    measured, guiding, stepped, known = measured.copy(), guiding.copy(), stepped.copy(), known.copy()
    for k in np.flatnonzero(part.free):
        m = part.markers[k]
        for axis in range(2):
            measured[m, axis] = xy[m, axis] + away[k, axis]
            guiding[m, axis] = measured[m, axis] if np.isfinite(guiding[m, axis]) else np.nan
        stepped[m], known[m] = far[k], diagonal[k]
    return measured, guiding, stepped, known


@compiled
def _gridlines_after_step(drew, away, own, part, read, gridlines):  # type: ignore[no-untyped-def]
    """Of all gridlines, those of the part as they were read: bending, how freely, information beside, use, foot and how
    far aside."""
    which, (bend, loose, joined, use, foot, aside) = part.gridlines, gridlines
    own_bend = bend_after_shift(read.bend, read.kept, away, read.lines, part.ends)
    own_foot = foot_levels(read.contrasts, selected_rows(drew[4], which), read.level_shift)
    bend, joined = replaced_table_rows(bend, which, own_bend), replaced_table_rows(joined, which, own)
    loose, use = replaced_rows(loose, which, read.bend_variance), replaced_rows(use, which, read.weight)
    foot, aside = replaced_rows(foot, which, own_foot), replaced_rows(aside, which, read.dot_gain_offset)
    return bend, loose, joined, use, foot, aside
