"""A step by synthesis around some markers: only what is drawn again is read, weighed and solved.

The markers that are drawn again are solved together with their neighbours, between others that are held where the last
step left them. Levels, blur, noise, dot gain and the usual misfit are those of the last step from everything.
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
    replaced_rows,
)
from extractor.refine.estimate import Estimate, PatternState
from extractor.refine.measure.gridline_bending import (
    MarkerRows,
    bend_after_shift,
    bending_misfit,
    estimate_bend_variance,
    measure_roughness,
    update_without_bending,
)
from extractor.refine.measure.gridline_weights import (
    ShiftGradients,
    gridline_misfits,
    misfit_weights,
    normalized_step_lengths,
    update_for_blur,
)
from extractor.refine.refinement_step import (
    PIXEL_MISFIT_RULE,
    extrapolate_pattern_around,
    prior_information,
)
from extractor.refine.solve.convergence import add_neighbours
from extractor.refine.solve.fisher_information import (
    HELD_INFORMATION,
    GridlineSystem,
    Information,
    fill_product,
    fisher_information,
    gradient,
    solve_shifts,
)
from extractor.refine.solve.subproblem import (
    held_shifts,
    replaced_table_rows,
    selected_rows,
    subproblem_around,
)
from extractor.refine.synthesis.dot_gain import update_without_dot_gain
from extractor.refine.synthesis.residual_kernel import A, B


class MarkerState(NamedTuple):
    """The part of an ``Estimate`` about the single markers; fields as there, and the information's ``diagonal``."""

    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]
    roughness: NDArray[np.float64]
    normalized_steps: NDArray[np.float64]
    diagonal: NDArray[np.float64]


class GridlineState(NamedTuple):
    """The part of an ``Estimate`` about the single gridlines; fields as there and in ``GridlineReading``, and the
    information's ``off_diagonal``."""

    bend: NDArray[np.float64]
    bend_variance: NDArray[np.float64]
    off_diagonal: NDArray[np.float64]
    weight: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]


class ImageState(NamedTuple):
    """The part of an ``Estimate`` that a partial step keeps; fields as there.

    Attributes:
        blur_change: px, by which the blur is larger than drawn.
        wide_blur: no gridline may bend, as the blur is wide.
    """

    noise: float
    median_misfit: float
    dot_gain: float
    blur_change: float
    wide_blur: bool


class PartialStep(NamedTuple):
    """The drawing, the markers and the gridlines after a partial step."""

    drawing: Synthesis
    markers: MarkerState
    gridlines: GridlineState


class SubproblemReading(NamedTuple):
    """The measurements along the gridlines (n) of a subproblem.

    Attributes:
        system: the gridlines, bending eliminated from the sums.
        gradients: likewise.
        bend, bend_variance: (n, 2) px as drawn, (n,) px^2.
        bend_response: (n, 6), as ``update_without_bending`` gives it.
        dot_gain_offset: (n,) px.
    """

    system: GridlineSystem
    gradients: ShiftGradients
    bend: NDArray[np.float64]
    bend_variance: NDArray[np.float64]
    bend_response: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]


def partial_step(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    drawing: Synthesis,
    redrawn: NDArray[np.bool_],
    buffers: DrawingBuffers,
    wide_blur: bool,
) -> tuple[Estimate, Synthesis]:
    """A step around some markers.

    Args:
        view: the image.
        topology: of the layout.
        estimate: after the last step.
        drawing: of the last step.
        redrawn: (M,) bool, the markers to draw again.
        buffers: with the drawing, written.
        wide_blur: no gridline may bend, as the blur is wide.

    Returns:
        The estimate and the drawing after the step.
    """
    reading, information = estimate.reading, estimate.information
    assert reading is not None
    where = estimate.measured, estimate.reliable, estimate.hidden, estimate.maps, estimate.roughness
    markers = MarkerState(*where, estimate.normalized_steps, information.diagonal)
    how = information.off_diagonal, reading.weight, reading.dot_gain_offset
    gridlines = GridlineState(estimate.bend, estimate.bend_variance, *how)
    image_state = ImageState(
        estimate.noise, estimate.median_misfit, estimate.dot_gain, estimate.sigma - drawing.sigma, wide_blur
    )
    step: PartialStep = _partial_step(
        view, topology, buffers, drawing, redrawn, markers, gridlines, image_state
    )
    drawing, of_markers, of_gridlines = step.drawing, step.markers._asdict(), step.gridlines._asdict()
    information = Information(of_markers.pop("diagonal"), of_gridlines.pop("off_diagonal"))
    fields = {name: of_gridlines.pop(name) for name in ("weight", "dot_gain_offset")}
    reading = reading._replace(lines=drawing.lines, sides=drawing.sides, added=drawing.added, **fields)
    fields = {**of_markers, **of_gridlines, "information": information, "reading": reading}
    return estimate._replace(xy=drawing.xy, **fields), drawing


@compiled
def _partial_step(view, topology, buffers, drawing, redrawn, markers, gridlines, image_state):  # type: ignore[no-untyped-def]
    """``PartialStep``; the buffers are written."""
    edges, reliable, diagonal = topology.edges, markers.reliable, markers.diagonal
    xy, hidden, maps = extrapolate_pattern_around(reliable, redrawn, markers.maps, topology)
    free, roughness = redrawn.copy(), markers.roughness
    add_neighbours(redrawn, edges, free)
    if not image_state.wide_blur:
        rows = MarkerRows(edges, topology.next_markers, topology.third_differences)
        new = measure_roughness(reliable, maps, diagonal, rows, topology.spokes, topology.ring_markers, free)
        roughness = merged_rows(free, new, roughness)
    noise, dot_gain = image_state.noise, image_state.dot_gain
    state = PatternState(
        xy, hidden, maps, roughness, gridlines.bend, gridlines.weight, drawing.sigma, noise, dot_gain
    )
    held = held_shifts(markers.measured, drawing.xy, redrawn)
    drawing = draw_pattern_part(view, topology, buffers, drawing, redrawn, state)
    part = subproblem_around(free, hidden, roughness, held, edges, topology.spokes)
    read = _subproblem_reading(drawing, part, topology.edge_cells, gridlines.weight, image_state)
    shifts, information = _solve_subproblem(part, read, gridlines.off_diagonal)
    markers = _markers_after_step(state, drawing.xy, shifts, information.diagonal, part, markers)
    gridlines = _gridlines_after_step(drawing, shifts, information.off_diagonal, part, read, gridlines)
    return PartialStep(drawing, markers, gridlines)


@compiled
def _subproblem_reading(drawing, part, edge_cells, weight, image_state):  # type: ignore[no-untyped-def]
    """``SubproblemReading`` from the drawing; ``weight`` (E,) are those of all gridlines before."""
    rule, sigma, variance = PIXEL_MISFIT_RULE, drawing.sigma, image_state.noise**2
    ids, values = part.gridlines, rule.values
    sums, lines = selected_rows(drawing.sums, ids), selected_rows(drawing.lines, ids)
    contrasts, bend = selected_rows(drawing.contrasts, ids), selected_rows(drawing.bend, ids)
    cells, gradients = selected_rows(edge_cells, ids), ShiftGradients(sums[:, A].copy(), sums[:, B].copy())
    update_for_blur(sums, gradients, image_state.blur_change)
    dot_gain_offset = update_without_dot_gain(sums, gradients, contrasts, cells, image_state.dot_gain)
    bend_variance = np.zeros(len(ids))
    if np.any(part.roughness) or np.any(bend):
        about = weight[ids], lines, part.ends, variance
        bend_variance = estimate_bend_variance(sums, gradients, bend, part.roughness, *about)
    bend_response = update_without_bending(sums, gradients, bend, bend_variance, variance)
    misfit = gridline_misfits(sums, gradients, values, rule.min_places)
    pardon = bending_misfit(bend_variance, contrasts, sigma)
    new_weight = misfit_weights(sums, misfit, image_state.median_misfit, pardon, values, rule.default_weight)
    system = GridlineSystem(sums, new_weight, lines, contrasts, part.ends, part.spokes, sigma, variance)
    return SubproblemReading(system, gradients, bend, bend_variance, bend_response, dot_gain_offset)


@compiled
def _solve_subproblem(part, read, off_diagonal):  # type: ignore[no-untyped-def]
    """(m, 2) px, the shifts of the markers of a subproblem from where they are drawn, and the ``Information``.

    ``off_diagonal``: (E, 4) 1/px^2, of all gridlines before.
    """
    diagonal, own = fisher_information(read.system, prior_information(part.hidden), True)
    for k in range(len(own)):
        if not (part.free[part.ends[k, 0]] and part.free[part.ends[k, 1]]):
            # not all gridlines at the other end are read, which share pixels with this one
            own[k] = off_diagonal[part.gridlines[k]]
    right = gradient(read.system, read.gradients.start, read.gradients.end)
    explained = np.empty_like(part.shifts)
    fill_product(diagonal, own, part.ends, part.shifts, explained)
    held = diagonal.copy()
    for k in range(len(held)):
        for axis in range(2):
            right[k, axis] = right[k, axis] - explained[k, axis] if part.free[k] else 0.0
        if not part.free[k]:
            held[k, 0], held[k, 1], held[k, 2] = HELD_INFORMATION, 0.0, HELD_INFORMATION
    shifts = part.shifts + solve_shifts(held, own, part.ends, right)
    return shifts, Information(diagonal, own)


@compiled
def _markers_after_step(state, xy, shifts, own_diagonal, part, markers):  # type: ignore[no-untyped-def]
    """``MarkerState`` with the solution for the free markers of the subproblem; ``xy`` (M, 2) is where they are
    drawn."""
    length = normalized_step_lengths(shifts, own_diagonal, part.hidden)
    measured, reliable = markers.measured.copy(), markers.reliable.copy()
    normalized_steps, diagonal = markers.normalized_steps.copy(), markers.diagonal.copy()
    for k in np.flatnonzero(part.free):
        m = part.markers[k]
        for axis in range(2):
            measured[m, axis] = xy[m, axis] + shifts[k, axis]
            reliable[m, axis] = measured[m, axis] if np.isfinite(reliable[m, axis]) else np.nan
        normalized_steps[m], diagonal[m] = length[k], own_diagonal[k]
    return MarkerState(
        measured, reliable, state.hidden, state.maps, state.roughness, normalized_steps, diagonal
    )


@compiled
def _gridlines_after_step(drawing, shifts, own_off_diagonal, part, read, gridlines):  # type: ignore[no-untyped-def]
    """``GridlineState`` with the measurements along the gridlines of the subproblem."""
    ids, system = part.gridlines, read.system
    own_bend = bend_after_shift(read.bend, read.bend_response, shifts, system.lines, part.ends)
    return GridlineState(
        replaced_table_rows(gridlines.bend, ids, own_bend),
        replaced_rows(gridlines.bend_variance, ids, read.bend_variance),
        replaced_table_rows(gridlines.off_diagonal, ids, own_off_diagonal),
        replaced_rows(gridlines.weight, ids, system.weight),
        replaced_rows(gridlines.dot_gain_offset, ids, read.dot_gain_offset),
    )
