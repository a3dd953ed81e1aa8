"""The pattern drawn over black, and what the image shows beyond it: of everything, or once more around some markers.

Each is one compiled function from the markers to the sums along the gridlines: between small ones, every array would be
handed to Python and back. Whatever is large is kept from image to image: fresh memory costs more than what is written
to it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Sight
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Fit
from extractor.refine.measure.gridline_bending import bending_ones
from extractor.refine.measure.gridline_weights import box_of, middles, usual_edge
from extractor.refine.solve.convergence import touching
from extractor.refine.synthesis.gridlines import gridlines
from extractor.refine.synthesis.ink_levels import Levels, black_at, cell_means, smoothed
from extractor.refine.synthesis.pattern_drawing import Strokes, draw_cells, erase_cells, room_for_strokes
from extractor.refine.synthesis.residual_kernel import clear, edge_contrasts, read_gridlines

MARGIN_SIGMA = 4.0


class Board(NamedTuple):
    """Room to draw in for one image size and layout.

    Attributes:
        picture: (H, W, 3) the pattern over black, as it was last drawn.
        strokes: of it.
        residual: (H * W * 3,) what the image shows beyond it.
    """

    picture: NDArray[np.float32]
    strokes: Strokes
    residual: NDArray[np.float32]


class Drawing(NamedTuple):
    """The pattern as it is drawn, and what was read along its gridlines.

    Attributes:
        xy, lines, bend: where: the markers (M, 2), gridlines (E, 8) and their bending (E, 2).
        contrasts, black: (E, 3) across the gridlines, and under their middles.
        sums: (E, 24), as ``read_gridlines`` gives them.
        levels, bettered: of the inks, as drawn, and as the cells' middles then said.
        box: of the image that is drawn. sigma: the blur. edge_px: a usual edge's length in it.
    """

    xy: NDArray[np.float64]
    lines: NDArray[np.float64]
    bend: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    black: NDArray[np.float64]
    sums: NDArray[np.float64]
    levels: Levels
    bettered: Levels
    box: NDArray[np.int64]
    sigma: float
    edge_px: float


def room_for(shape: tuple[int, ...], mesh: Topology) -> Board:
    """An empty board for images of a shape."""
    residual = np.empty(int(np.prod(shape)), np.float32)
    return Board(np.zeros(shape, np.float32), room_for_strokes(len(mesh.cells)), residual)


def drawn(view: Sight, mesh: Topology, fit: Fit, board: Board) -> Drawing:
    """Everything as the fit says."""
    image, sigma = view.image, fit.sigma
    box = box_of(fit.xy, MARGIN_SIGMA * sigma + 2, image.shape[1], image.shape[0])
    inside = mesh.black, mesh.cell_color, fit.noise
    pattern = fit.xy, fit.maps, fit.bend, fit.rough
    look = look_of(view, fit.levels, sigma, box)
    read, edge_px, bettered = _drawn(image, tuple(board), pattern, sides_of(mesh), look, inside)
    lines, contrasts, black, sums = read
    where = fit.xy, lines, fit.bend
    return Drawing(*where, contrasts, black, sums, fit.levels, Levels(*bettered), box, sigma, edge_px)


def sides_of(mesh: Topology) -> tuple[NDArray[Any], ...]:
    """Which cells, gridlines and markers belong together, as compiled functions take it."""
    return mesh.cells, mesh.cell_edges, mesh.edges, mesh.edge_cells, mesh.along


def look_of(view: Sight, levels: Levels, sigma: float, box: NDArray[np.int64]) -> tuple[Any, ...]:
    """How the pattern looks, likewise: levels, black, the frame of these, blur and box."""
    return (levels.cell, levels.slope), levels.black, tuple(view.frame), sigma, box


@compiled
def _drawn(image, board, pattern, sides, look, inside):  # type: ignore[no-untyped-def]
    """Lines, contrasts, black and sums of a ``Drawing``; a usual edge's length; and the bettered levels."""
    picture, strokes, residual = board
    xy, maps, bend, rough = pattern
    cells, cell_edges, edges, edge_cells, along = sides
    (cell, slope), black, frame, sigma, box = look
    lines = gridlines(xy, maps, bend, edges, along)
    contrasts = edge_contrasts(lines, xy, cells, edge_cells, cell, slope)
    clear(picture, box)
    strokes.used[:] = 0
    every, colors = np.ones(len(cells), np.bool_), (cell, slope, sigma, box, picture, strokes)
    draw_cells(every, 1.0, xy, cells, cell_edges, edges, lines, *colors)
    below, loose = black_at(black, middles(lines), *frame), bending_ones(rough, bend, edges)
    sums = read_gridlines(image, picture, lines, contrasts, below, sigma, box, loose, residual)
    bettered = _bettered(image, picture, xy, cells, cell, frame, *inside)
    return (lines, contrasts, below, sums), usual_edge(xy, edges), bettered


@compiled
def _bettered(image, picture, xy, cells, cell, frame, black_cells, color, noise):  # type: ignore[no-untyped-def]
    """Levels corrected by what the drawing does not explain in the middle of the cells."""
    own = cell_means(image, picture, xy, cells, 0.0)
    own[:, :3] += cell
    black = cell_means(image, picture, xy, black_cells, 0.0)
    return smoothed(own, black, xy, cells, black_cells, color, noise, *frame)


@compiled
def redrawn(image, board, pattern, sides, look, anew, before):  # type: ignore[no-untyped-def]
    """The first six of a ``Drawing``, as they were ``before`` but for the markers that are ``anew`` (M,) bool, and all
    gridlines and cells that they belong to; these as the ``pattern`` says."""
    picture, strokes, residual = board
    xy, maps, bend, rough = pattern
    cells, cell_edges, edges, edge_cells, along = sides
    (cell, slope), black, frame, sigma, box = look
    old_xy, old_lines, old_bend, old_contrasts, old_black, old_sums = before
    some, which = np.flatnonzero(touching(anew, edges)), touching(anew, cells)
    xy, bend, ends = chosen(anew, xy, old_xy), bend[some], edges[some]
    own = gridlines(xy, maps, bend, ends, along[some])
    contrasts = edge_contrasts(own, xy, cells, edge_cells[some], cell, slope)
    lines, colors = replaced(old_lines, some, own), (cell, slope, sigma, box, picture, strokes)
    erase_cells(which, old_xy, cells, cell_edges, edges, old_lines, *colors)
    draw_cells(which, 1.0, xy, cells, cell_edges, edges, lines, *colors)
    below, loose = black_at(black, middles(own), *frame), bending_ones(rough, bend, ends)
    sums = read_gridlines(image, picture, own, contrasts, below, sigma, box, loose, residual)
    contrasts, below = replaced(old_contrasts, some, contrasts), replaced(old_black, some, below)
    return xy, lines, replaced(old_bend, some, bend), contrasts, below, replaced(old_sums, some, sums)


@compiled
def chosen(which, ones, others):  # type: ignore[no-untyped-def]
    """Rows of ``ones`` where ``which``, of ``others`` elsewhere."""
    out = others.copy()
    for i in range(which.shape[0]):
        if which[i]:
            out[i] = ones[i]
    return out


@compiled
def replaced(rows, some, ones):  # type: ignore[no-untyped-def]
    """The rows with others at these numbers (n,)."""
    out = rows.copy()
    out[some] = ones
    return out
