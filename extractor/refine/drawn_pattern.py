"""The pattern drawn over black, and the residual along its gridlines: of everything, or again around some markers.

One compiled function leads from the markers to the sums along the gridlines: between small functions, every array would
pass through Python. Large arrays are kept from image to image: fresh memory costs more than writing to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import bending_gridlines
from extractor.refine.measure.gridline_weights import chord_midpoints, median_edge, pattern_box
from extractor.refine.solve.convergence import groups_with_any
from extractor.refine.synthesis.gridlines import gridlines
from extractor.refine.synthesis.ink_levels import (
    InkCells,
    InkLevels,
    black_levels_at,
    cell_means,
    smoothed_levels,
)
from extractor.refine.synthesis.pattern_drawing import (
    CellAppearance,
    CellGeometry,
    CoverageRuns,
    allocate_coverage_runs,
    draw_cells,
    update_erasing_cells,
)
from extractor.refine.synthesis.residual_kernel import (
    DrawnGridlines,
    accumulate_residual_sums,
    fill_zeros,
    update_known_contrasts,
)

MARGIN_SIGMA = 4.0  # blurs around the pattern that are drawn


class DrawingBuffers(NamedTuple):
    """Memory to draw in for one image size and layout.

    Attributes:
        synthetic_image: (H, W, 3) the pattern over black, as it was last drawn.
        coverage_runs: the coverages of that drawing.
        residual: (H * W * 3,) the image minus that drawing.
    """

    synthetic_image: NDArray[np.float32]
    coverage_runs: CoverageRuns
    residual: NDArray[np.float32]


class Synthesis(NamedTuple):
    """The pattern as it is drawn, and the sums along its gridlines.

    Attributes:
        xy, lines, bend: the markers (M, 2) px, the gridlines (E, 8) and their bending (E, 2) px.
        contrasts, black: (E, 3) across the gridlines, and under their middles.
        sums: (E, 24), as ``accumulate_residual_sums`` gives them.
        levels: of the inks, as drawn.
        corrected_levels: of the inks, corrected by the residual in the middles of the cells.
        box: (4,) the part of the image that is drawn: x from, y from, x to, y to.
        sigma: the blur, px.
        edge_px: the median length of the gridlines.
    """

    xy: NDArray[np.float64]
    lines: NDArray[np.float64]
    bend: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    black: NDArray[np.float64]
    sums: NDArray[np.float64]
    levels: InkLevels
    corrected_levels: InkLevels
    box: NDArray[np.int64]
    sigma: float
    edge_px: float


def allocate_drawing_buffers(shape: tuple[int, ...], topology: Topology) -> DrawingBuffers:
    """Buffers for images of a shape (H, W, 3), nothing drawn."""
    residual = np.empty(int(np.prod(shape)), np.float32)
    return DrawingBuffers(np.zeros(shape, np.float32), allocate_coverage_runs(len(topology.cells)), residual)


def draw_pattern(
    view: PyramidLevel, topology: Topology, estimate: Estimate, buffers: DrawingBuffers
) -> Synthesis:
    """Draw the whole pattern of the estimate into the buffers, and compare it with the image."""
    height, width = view.image.shape[:2]
    box = pattern_box(estimate.xy, MARGIN_SIGMA * estimate.sigma + 2, width, height)
    state = estimate.pattern_state()
    drawing: Synthesis = _draw_pattern(view, topology, buffers, state, estimate.levels, box)
    return drawing


@compiled
def _draw_pattern(view, topology, buffers, state, levels, box):  # type: ignore[no-untyped-def]
    """``Synthesis`` of a ``PatternState`` with ``InkLevels`` within the box (4,)."""
    image, picture, strokes = view.image, buffers.synthetic_image, buffers.coverage_runs
    xy, bend, sigma = state.xy, state.bend, state.sigma
    cells, cell_edges, edges = topology.cells, topology.cell_edges, topology.edges
    cell, slope = levels.cell, levels.slope
    lines = gridlines(xy, state.maps, bend, edges, topology.edge_vectors)
    contrasts = update_known_contrasts(lines, xy, cells, topology.edge_cells, cell, slope)
    fill_zeros(picture, box)
    strokes.used[:] = 0
    every, geometry = np.ones(len(cells), np.bool_), CellGeometry(xy, cells, cell_edges, edges, lines)
    draw_cells(every, 1.0, geometry, CellAppearance(cell, slope, sigma), box, picture, strokes)
    black = black_levels_at(levels.black, chord_midpoints(lines), view.frame)
    drawn = DrawnGridlines(lines, contrasts, black, bending_gridlines(state.roughness, bend, edges))
    sums = accumulate_residual_sums(image, picture, drawn, sigma, box, buffers.residual)
    corrected = _corrected_levels(view, picture, topology, xy, cell, state.noise)
    edge_px = median_edge(xy, edges)
    return Synthesis(xy, lines, bend, contrasts, black, sums, levels, corrected, box, sigma, edge_px)


@compiled
def _corrected_levels(view, picture, topology, xy, cell, noise):  # type: ignore[no-untyped-def]
    """``InkLevels``: the levels ``cell`` (K, 3) corrected by the residual in the middle of the cells."""
    cells, black_cells, color = topology.cells, topology.black_cells, topology.cell_color
    own = cell_means(view.image, picture, xy, cells, 0.0)
    own[:, :3] += cell
    black = cell_means(view.image, picture, xy, black_cells, 0.0)
    return smoothed_levels(own, black, xy, InkCells(cells, black_cells, color), noise, view.frame)


@compiled
def draw_pattern_part(view, topology, buffers, drawing, redrawn, state):  # type: ignore[no-untyped-def]
    """Draw some markers again, with all gridlines and cells that they belong to.

    Args:
        view: the image.
        topology: of the layout.
        buffers: ``DrawingBuffers`` with the drawing, written.
        drawing: ``Synthesis`` as it was.
        redrawn: (M,) bool, the markers to draw again.
        state: ``PatternState``, where these are drawn; its blur is not used.

    Returns:
        ``Synthesis``: markers, gridlines, contrasts, black and sums are new where drawn again.
    """
    image, picture, strokes = view.image, buffers.synthetic_image, buffers.coverage_runs
    sigma, box = drawing.sigma, drawing.box
    cells, cell_edges, edges = topology.cells, topology.cell_edges, topology.edges
    cell, slope = drawing.levels.cell, drawing.levels.slope
    edge_ids, redrawn_cells = np.flatnonzero(groups_with_any(redrawn, edges)), groups_with_any(redrawn, cells)
    xy, bend, ends = merged_rows(redrawn, state.xy, drawing.xy), state.bend[edge_ids], edges[edge_ids]
    own = gridlines(xy, state.maps, bend, ends, topology.edge_vectors[edge_ids])
    contrasts = update_known_contrasts(own, xy, cells, topology.edge_cells[edge_ids], cell, slope)
    lines, appearance = replaced_rows(drawing.lines, edge_ids, own), CellAppearance(cell, slope, sigma)
    old_geometry = CellGeometry(drawing.xy, cells, cell_edges, edges, drawing.lines)
    update_erasing_cells(redrawn_cells, old_geometry, appearance, box, picture, strokes)
    geometry = CellGeometry(xy, cells, cell_edges, edges, lines)
    draw_cells(redrawn_cells, 1.0, geometry, appearance, box, picture, strokes)
    black = black_levels_at(drawing.levels.black, chord_midpoints(own), view.frame)
    drawn = DrawnGridlines(own, contrasts, black, bending_gridlines(state.roughness, bend, ends))
    sums = accumulate_residual_sums(image, picture, drawn, sigma, box, buffers.residual)
    return Synthesis(
        xy,
        lines,
        replaced_rows(drawing.bend, edge_ids, bend),
        replaced_rows(drawing.contrasts, edge_ids, contrasts),
        replaced_rows(drawing.black, edge_ids, black),
        replaced_rows(drawing.sums, edge_ids, sums),
        drawing.levels,
        drawing.corrected_levels,
        box,
        sigma,
        drawing.edge_px,
    )


@compiled
def merged_rows(selected, rows, other_rows):  # type: ignore[no-untyped-def]
    """``rows`` (n, ...) where selected (n,) bool, ``other_rows`` elsewhere."""
    out = other_rows.copy()
    for i in range(selected.shape[0]):
        if selected[i]:
            out[i] = rows[i]
    return out


@compiled
def replaced_rows(table, numbers, rows):  # type: ignore[no-untyped-def]
    """A copy of the table with other ``rows`` at these numbers (n,)."""
    out = table.copy()
    out[numbers] = rows
    return out
