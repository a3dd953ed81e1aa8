"""The pattern drawn as light over black, and the residual along its gridlines.

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
from extractor.refine.measure.gridline_weights import median_edge, pattern_box
from extractor.refine.synthesis.blur_bleed import levels_at_blur
from extractor.refine.synthesis.gridline_sides import add_black, gridline_sides, value_contrasts
from extractor.refine.synthesis.gridlines import gridlines
from extractor.refine.synthesis.ink_levels import (
    InkCells,
    InkLevels,
    cell_means,
    smoothed_levels,
)
from extractor.refine.synthesis.pattern_drawing import (
    CellAppearance,
    CellGeometry,
    draw_cells,
)
from extractor.refine.synthesis.residual_kernel import DrawnGridlines, accumulate_residual_sums, fill_zeros

MARGIN_SIGMA = 4.0  # blurs around the pattern that are drawn
BLUR_STEP = 0.02  # of the blur, for derivatives of the levels


class Synthesis(NamedTuple):
    """The pattern as it is drawn, and the sums along its gridlines.

    Attributes:
        xy, lines, bend: the markers (M, 2) px, the gridlines (E, 8) and their bending (E, 2) px.
        sides, contrasts: (E, 6) and (E, 3), as ``gridline_sides`` and ``value_contrasts`` give them.
        added: (E, 6), the light to add on both sides: the black, and the difference of the corrected levels.
        sums: (E, 24), as ``accumulate_residual_sums`` gives them.
        corrected_levels: of the inks, corrected by the residual in the middles of the cells.
        sigma: the blur, px.
        edge_px: the median length of the gridlines.
    """

    xy: NDArray[np.float64]
    lines: NDArray[np.float64]
    bend: NDArray[np.float64]
    sides: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    added: NDArray[np.float64]
    sums: NDArray[np.float64]
    corrected_levels: InkLevels
    sigma: float
    edge_px: float


def draw_pattern(
    view: PyramidLevel, topology: Topology, estimate: Estimate, picture: NDArray[np.float32]
) -> Synthesis:
    """Draw the whole pattern of the estimate into the picture (H, W, 3), and compare it with the image."""
    height, width = view.image.shape[:2]
    box = pattern_box(estimate.xy, MARGIN_SIGMA * estimate.sigma + 2, width, height)
    state = estimate.pattern_state()
    drawing: Synthesis = _draw_pattern(view, topology, picture, state, estimate.levels, box)
    return drawing


@compiled
def _draw_pattern(view, topology, picture, state, levels, box):  # type: ignore[no-untyped-def]
    """``Synthesis`` of a ``PatternState`` with ``InkLevels`` within the box (4,)."""
    xy, bend, sigma = state.xy, state.bend, state.sigma
    cells, cell_edges, edges = topology.cells, topology.cell_edges, topology.edges
    cell, slope = levels.cell, levels.slope
    lines = gridlines(xy, state.maps, bend, edges, topology.edge_vectors)
    sides = gridline_sides(lines, xy, cells, topology.edge_cells, levels, view.frame)
    fill_zeros(picture, box)
    geometry = CellGeometry(xy, cells, cell_edges, edges, lines)
    draw_cells(geometry, CellAppearance(cell, slope, sigma), box, picture)
    corrected = _corrected_levels(view, picture, topology, xy, levels, state.noise)
    added = gridline_sides(lines, xy, cells, topology.edge_cells, corrected, view.frame) - sides
    add_black(added, lines, levels.black, view.frame)
    wider = levels_at_blur(levels, xy, cells, topology.cell_color, sigma, (1.0 + BLUR_STEP) * sigma)
    bleed = gridline_sides(lines, xy, cells, topology.edge_cells, wider, view.frame) - sides
    bleed /= BLUR_STEP
    drawn = DrawnGridlines(lines, sides, added, bleed, bending_gridlines(state.roughness, bend, edges))
    sums = accumulate_residual_sums(view, picture, drawn, sigma, box)
    contrasts, edge_px = value_contrasts(sides, view.response.encoded), median_edge(xy, edges)
    return Synthesis(xy, lines, bend, sides, contrasts, added, sums, corrected, sigma, edge_px)


@compiled
def _corrected_levels(view, picture, topology, xy, levels, noise):  # type: ignore[no-untyped-def]
    """``InkLevels`` corrected by the residual in the middle of the cells."""
    cells, black_cells, color = topology.cells, topology.black_cells, topology.cell_color
    own = cell_means(view.image, view.response.light, picture, xy, cells, 0.0)
    own[:, :3] += levels.cell
    black = cell_means(view.image, view.response.light, picture, xy, black_cells, 0.0)
    return smoothed_levels(own, black, xy, InkCells(cells, black_cells, color), noise, view)
