"""How an image looks before anything is measured: its noise, the inks' levels, what changes across the gridlines, and
the blur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.input import estimate_noise
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Appearance, EdgeContrasts, Estimate
from extractor.refine.measure.edge_profiles import channel_projections, profile_blur
from extractor.refine.measure.gridline_weights import MIN_NOISE
from extractor.refine.synthesis.blur_bleed import bleed_shares, remove_bleed
from extractor.refine.synthesis.ink_levels import InkLevels, cell_means, smoothed_levels
from extractor.refine.synthesis.residual_kernel import update_known_contrasts
from extractor.refine.synthesis_steps import MIN_SIGMA_PX

DEFAULT_SIGMA_PX = 1.5  # before it is known
FALLBACK_SIGMA_PX = 0.9  # where no gridline shows it
MIN_CORRECTED_BLEED = 0.002  # of a neighbour's level in the middle of a cell, from which on it is taken out
BLUR_GRIDLINES = 60  # gridlines that the first estimate of the blur is taken from
NO_MODEL = np.empty((0, 0, 3), np.float32)


def initial_appearance(view: PyramidLevel, mesh: Topology, xy: NDArray[np.float64]) -> Appearance:
    """The noise and the levels in the middles of the cells; the blur is not known yet."""
    usual, tables = DEFAULT_SIGMA_PX / view.scale, (mesh.cells, mesh.black_cells, mesh.cell_color)
    noise, *levels = _initial_appearance(view.image, NO_MODEL, xy, *tables, usual, *view.frame)
    return Appearance(view.scale, 0.0, noise, InkLevels(*levels), noise)


@compiled
def _initial_appearance(image, nothing, xy, cells, black_cells, color, sigma, x0, y0, scale):  # type: ignore[no-untyped-def]
    noise = np.maximum(estimate_noise(image, xy, cells), MIN_NOISE)
    drawn = cell_means(image, nothing, xy, cells, sigma)
    black = cell_means(image, nothing, xy, black_cells, sigma)
    return (noise,) + smoothed_levels(drawn, black, xy, cells, black_cells, color, noise, x0, y0, scale)


def update_edge_contrasts(
    view: PyramidLevel, mesh: Topology, fit: Estimate, lines: NDArray[np.float64]
) -> EdgeContrasts:
    """The colors beside the gridlines."""
    levels = fit.levels.cell, fit.levels.slope, fit.levels.black
    return EdgeContrasts(
        *_update_edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, *levels, *view.frame)
    )


@compiled
def _update_edge_contrasts(lines, xy, cells, edge_cells, cell, slope, black, x0, y0, scale):  # type: ignore[no-untyped-def]
    contrasts = update_known_contrasts(lines, xy, cells, edge_cells, cell, slope)
    weights, room = channel_projections(lines, contrasts, xy, cells, edge_cells, cell, black, x0, y0, scale)
    return contrasts, weights, room


def update_blur_and_bleed(
    view: PyramidLevel, mesh: Topology, fit: Estimate, lines: NDArray[np.float64], beside: EdgeContrasts
) -> tuple[Estimate, EdgeContrasts]:
    """The fit with the blur that some of the gridlines show, and its levels without what that brings into the middle of
    a cell from its neighbours."""
    shown = view.image, lines, beside.weights, beside.clearance
    sigma, share, usual = _blur_and_bleed(*shown, fit.xy, mesh.cells, DEFAULT_SIGMA_PX / view.scale)
    fit = fit._replace(sigma=sigma)
    if usual > MIN_CORRECTED_BLEED:
        fit = fit._replace(levels=remove_bleed(fit.levels, mesh.cell_color, share, usual))
        beside = update_edge_contrasts(view, mesh, fit, lines)
    return fit, beside


@compiled
def _blur_and_bleed(image, lines, weights, room, xy, cells, assumed):  # type: ignore[no-untyped-def]
    """The blur, px; and what it makes of neighbours in the cells' means, as ``bleed_shares`` tells it."""
    sigma = profile_blur(image, lines, weights, room, BLUR_GRIDLINES)
    sigma = max(sigma, MIN_SIGMA_PX) if np.isfinite(sigma) else FALLBACK_SIGMA_PX
    share, usual = bleed_shares(xy, cells, sigma, assumed)
    return sigma, share, usual
