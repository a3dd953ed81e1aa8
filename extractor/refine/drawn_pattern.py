"""The pattern drawn over black, and what the image shows beyond it: of everything, or once more around some markers.

Each is one compiled function from the markers to the sums along the gridlines: between small ones, every array would be
handed to Python and back. Whatever is large is kept from image to image: fresh memory costs more than what is written
to it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

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
from extractor.refine.synthesis.ink_levels import InkLevels, black_levels_at, cell_means, smoothed_levels
from extractor.refine.synthesis.pattern_drawing import (
    CoverageRuns,
    allocate_coverage_runs,
    draw_cells,
    update_erasing_cells,
)
from extractor.refine.synthesis.residual_kernel import (
    accumulate_residual_sums,
    fill_zeros,
    update_known_contrasts,
)

MARGIN_SIGMA = 4.0


class DrawingBuffers(NamedTuple):
    """Room to draw in for one image size and layout.

    Attributes:
        picture: (H, W, 3) the pattern over black, as it was last drawn.
        strokes: of it.
        residual: (H * W * 3,) what the image shows beyond it.
    """

    synthetic_image: NDArray[np.float32]
    coverage_runs: CoverageRuns
    residual: NDArray[np.float32]


class Synthesis(NamedTuple):
    """The pattern as it is drawn, and what was read along its gridlines.

    Attributes:
        xy, lines, bend: where: the markers (M, 2), gridlines (E, 8) and their bending (E, 2).
        contrasts, black: (E, 3) across the gridlines, and under their middles.
        sums: (E, 24), as ``accumulate_residual_sums`` gives them.
        levels, bettered: of the inks, as drawn, and as the cells' middles then said.
        box: of the image that is drawn. sigma: the blur. edge_px: a usual edge's length in it.
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


def allocate_drawing_buffers(shape: tuple[int, ...], mesh: Topology) -> DrawingBuffers:
    """An empty board for images of a shape."""
    residual = np.empty(int(np.prod(shape)), np.float32)
    return DrawingBuffers(np.zeros(shape, np.float32), allocate_coverage_runs(len(mesh.cells)), residual)


def draw_pattern(view: PyramidLevel, mesh: Topology, fit: Estimate, board: DrawingBuffers) -> Synthesis:
    """Everything as the fit says."""
    image, sigma = view.image, fit.sigma
    box = pattern_box(fit.xy, MARGIN_SIGMA * sigma + 2, image.shape[1], image.shape[0])
    inside = mesh.black_cells, mesh.cell_color, fit.noise
    pattern = fit.xy, fit.maps, fit.bend, fit.roughness
    look = packed_appearance(view, fit.levels, sigma, box)
    read, edge_px, bettered = _draw_pattern(image, tuple(board), pattern, packed_topology(mesh), look, inside)
    lines, contrasts, black, sums = read
    where = fit.xy, lines, fit.bend
    return Synthesis(*where, contrasts, black, sums, fit.levels, InkLevels(*bettered), box, sigma, edge_px)


def packed_topology(mesh: Topology) -> tuple[NDArray[Any], ...]:
    """Which cells, gridlines and markers belong together, as compiled functions take it."""
    return mesh.cells, mesh.cell_edges, mesh.edges, mesh.edge_cells, mesh.edge_vectors


def packed_appearance(
    view: PyramidLevel, levels: InkLevels, sigma: float, box: NDArray[np.int64]
) -> tuple[Any, ...]:
    """How the pattern looks, likewise: levels, black, the frame of these, blur and box."""
    return (levels.cell, levels.slope), levels.black, tuple(view.frame), sigma, box


@compiled
def _draw_pattern(image, board, pattern, sides, look, inside):  # type: ignore[no-untyped-def]
    """Lines, contrasts, black and sums of a ``Synthesis``; a usual edge's length; and the bettered levels."""
    picture, strokes, residual = board
    xy, maps, bend, rough = pattern
    cells, cell_edges, edges, edge_cells, along = sides
    (cell, slope), black, frame, sigma, box = look
    lines = gridlines(xy, maps, bend, edges, along)
    contrasts = update_known_contrasts(lines, xy, cells, edge_cells, cell, slope)
    fill_zeros(picture, box)
    strokes.used[:] = 0
    every, colors = np.ones(len(cells), np.bool_), (cell, slope, sigma, box, picture, strokes)
    draw_cells(every, 1.0, xy, cells, cell_edges, edges, lines, *colors)
    below, loose = (
        black_levels_at(black, chord_midpoints(lines), *frame),
        bending_gridlines(rough, bend, edges),
    )
    sums = accumulate_residual_sums(image, picture, lines, contrasts, below, sigma, box, loose, residual)
    bettered = _corrected_levels(image, picture, xy, cells, cell, frame, *inside)
    return (lines, contrasts, below, sums), median_edge(xy, edges), bettered


@compiled
def _corrected_levels(image, picture, xy, cells, cell, frame, black_cells, color, noise):  # type: ignore[no-untyped-def]
    """Levels corrected by what the drawing does not explain in the middle of the cells."""
    own = cell_means(image, picture, xy, cells, 0.0)
    own[:, :3] += cell
    black = cell_means(image, picture, xy, black_cells, 0.0)
    return smoothed_levels(own, black, xy, cells, black_cells, color, noise, *frame)


@compiled
def draw_pattern_part(image, board, pattern, sides, look, anew, before):  # type: ignore[no-untyped-def]
    """The first six of a ``Synthesis``, as they were ``before`` but for the markers that are ``anew`` (M,) bool, and
    all
    gridlines and cells that they belong to; these as the ``pattern`` says."""
    picture, strokes, residual = board
    xy, maps, bend, rough = pattern
    cells, cell_edges, edges, edge_cells, along = sides
    (cell, slope), black, frame, sigma, box = look
    old_xy, old_lines, old_bend, old_contrasts, old_black, old_sums = before
    some, which = np.flatnonzero(groups_with_any(anew, edges)), groups_with_any(anew, cells)
    xy, bend, ends = merged_rows(anew, xy, old_xy), bend[some], edges[some]
    own = gridlines(xy, maps, bend, ends, along[some])
    contrasts = update_known_contrasts(own, xy, cells, edge_cells[some], cell, slope)
    lines, colors = replaced_rows(old_lines, some, own), (cell, slope, sigma, box, picture, strokes)
    update_erasing_cells(which, old_xy, cells, cell_edges, edges, old_lines, *colors)
    draw_cells(which, 1.0, xy, cells, cell_edges, edges, lines, *colors)
    below, loose = black_levels_at(black, chord_midpoints(own), *frame), bending_gridlines(rough, bend, ends)
    sums = accumulate_residual_sums(image, picture, own, contrasts, below, sigma, box, loose, residual)
    contrasts, below = replaced_rows(old_contrasts, some, contrasts), replaced_rows(old_black, some, below)
    return (
        xy,
        lines,
        replaced_rows(old_bend, some, bend),
        contrasts,
        below,
        replaced_rows(old_sums, some, sums),
    )


@compiled
def merged_rows(which, ones, others):  # type: ignore[no-untyped-def]
    """Rows of ``ones`` where ``gridlines``, of ``others`` elsewhere."""
    out = others.copy()
    for i in range(which.shape[0]):
        if which[i]:
            out[i] = ones[i]
    return out


@compiled
def replaced_rows(rows, some, ones):  # type: ignore[no-untyped-def]
    """The rows with others at these numbers (n,)."""
    out = rows.copy()
    out[some] = ones
    return out
