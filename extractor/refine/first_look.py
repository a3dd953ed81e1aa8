"""The appearance of an image before anything is measured: noise, levels of the inks, contrasts, and blur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.input import estimate_noise
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Appearance, EdgeContrasts, Estimate
from extractor.refine.measure.edge_profiles import gridline_clearance, profile_blur
from extractor.refine.measure.gridline_weights import MIN_NOISE, MIN_SIGMA_PX
from extractor.refine.synthesis.blur_bleed import bleed_shares, remove_bleed
from extractor.refine.synthesis.gridline_sides import gridline_sides, value_contrasts
from extractor.refine.synthesis.ink_levels import InkCells, cell_means, smoothed_levels

DEFAULT_SIGMA_PX = 1.5  # assumed before the blur is measured
FALLBACK_SIGMA_PX = 0.9  # where no gridline shows the blur
MIN_CORRECTED_BLEED = 0.002  # of a neighbour's level in the middle of a cell, above which bleed is removed
BLUR_GRIDLINES = 60  # gridlines for the first estimate of the blur
NO_MODEL = np.empty((0, 0, 3), np.float32)


def initial_appearance(view: PyramidLevel, topology: Topology, xy: NDArray[np.float64]) -> Appearance:
    """The noise, and the levels from the middles of the cells at the markers (M, 2), px; the blur is 0: not known."""
    noise, levels = _initial_appearance(view, topology, xy, DEFAULT_SIGMA_PX / view.scale, NO_MODEL)
    return Appearance(view.scale, 0.0, noise, levels, noise)


@compiled
def _initial_appearance(view, topology, xy, sigma, no_model):  # type: ignore[no-untyped-def]
    """The noise and ``InkLevels``."""
    image, cells, black_cells, color = view.image, topology.cells, topology.black_cells, topology.cell_color
    noise = np.maximum(estimate_noise(image, xy, cells), MIN_NOISE)
    drawn = cell_means(image, view.response.light, no_model, xy, cells, sigma)
    black = cell_means(image, view.response.light, no_model, xy, black_cells, sigma)
    return noise, smoothed_levels(drawn, black, xy, InkCells(cells, black_cells, color), noise, view)


def update_edge_contrasts(
    view: PyramidLevel, topology: Topology, estimate: Estimate, lines: NDArray[np.float64]
) -> EdgeContrasts:
    """The contrasts across the gridlines (E, 8). Those beside unknown cells are marked as not known in ``lines``."""
    contrasts: EdgeContrasts = _update_edge_contrasts(lines, estimate.xy, topology, estimate.levels, view)
    return contrasts


@compiled
def _update_edge_contrasts(lines, xy, topology, levels, view):  # type: ignore[no-untyped-def]
    cells, edge_cells = topology.cells, topology.edge_cells
    sides = gridline_sides(lines, xy, cells, edge_cells, levels, view.frame)
    contrasts = value_contrasts(sides, view.response.encoded)
    return EdgeContrasts(sides, contrasts, gridline_clearance(lines, contrasts, xy, cells, edge_cells))


def update_blur_and_bleed(
    view: PyramidLevel,
    topology: Topology,
    estimate: Estimate,
    lines: NDArray[np.float64],
    contrasts: EdgeContrasts,
) -> tuple[Estimate, EdgeContrasts]:
    """The estimate with the blur that some of the gridlines (E, 8) show, and with levels and contrasts without
    bleed."""
    assumed = DEFAULT_SIGMA_PX / view.scale
    sigma, share, median_share = _blur_and_bleed(view, lines, contrasts, estimate.xy, topology.cells, assumed)
    estimate = estimate._replace(sigma=sigma)
    if median_share > MIN_CORRECTED_BLEED:
        levels = remove_bleed(estimate.levels, topology.cell_color, share, median_share)
        estimate = estimate._replace(levels=levels)
        contrasts = update_edge_contrasts(view, topology, estimate, lines)
    return estimate, contrasts


@compiled
def _blur_and_bleed(view, lines, across, xy, cells, assumed):  # type: ignore[no-untyped-def]
    """The blur, px; and the bleed of each cell and its median, as ``bleed_shares`` gives them."""
    sigma = profile_blur(view, lines, across, BLUR_GRIDLINES)
    sigma = max(sigma, MIN_SIGMA_PX) if np.isfinite(sigma) else FALLBACK_SIGMA_PX
    share, median_share = bleed_shares(xy, cells, sigma, assumed)
    return sigma, share, median_share
