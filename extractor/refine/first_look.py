"""How an image looks before anything is measured: its noise, the inks' levels, what changes across the gridlines, and
the blur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor.image.input import estimate_noise
from extractor.image.pyramid import Sight
from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Across, Fit, Seen
from extractor.refine.measure.edge_profiles import profile_blur, unmixing
from extractor.refine.measure.gridline_weights import MIN_NOISE
from extractor.refine.synthesis.blur_bleed import bled, unbled
from extractor.refine.synthesis.ink_levels import Levels, cell_means, smoothed
from extractor.refine.synthesis.residual_kernel import edge_contrasts
from extractor.refine.synthesis_steps import MIN_SIGMA_PX

USUAL_SIGMA_PX = 1.5  # before it is known
BLIND_SIGMA_PX = 0.9  # where no gridline shows it
BLEEDING = 0.002  # of a neighbour's level in the middle of a cell, from which on it is taken out
BLUR_EDGES = 60  # gridlines that the first estimate of the blur is taken from
NO_MODEL = np.empty((0, 0, 3), np.float32)


def first_look(view: Sight, mesh: Topology, xy: NDArray[np.float64]) -> Seen:
    """The noise and the levels in the middles of the cells; the blur is not known yet."""
    usual, tables = USUAL_SIGMA_PX / view.scale, (mesh.cells, mesh.black, mesh.cell_color)
    noise, *levels = _first_look(view.image, NO_MODEL, xy, *tables, usual, *view.frame)
    return Seen(view.scale, 0.0, noise, Levels(*levels), noise)


@compiled
def _first_look(image, nothing, xy, cells, black_cells, color, sigma, x0, y0, scale):  # type: ignore[no-untyped-def]
    noise = np.maximum(estimate_noise(image, xy, cells), MIN_NOISE)
    drawn = cell_means(image, nothing, xy, cells, sigma)
    black = cell_means(image, nothing, xy, black_cells, sigma)
    return (noise,) + smoothed(drawn, black, xy, cells, black_cells, color, noise, x0, y0, scale)


def across(view: Sight, mesh: Topology, fit: Fit, lines: NDArray[np.float64]) -> Across:
    """The colors beside the gridlines."""
    levels = fit.levels.cell, fit.levels.slope, fit.levels.black
    return Across(*_across(lines, fit.xy, mesh.cells, mesh.edge_cells, *levels, *view.frame))


@compiled
def _across(lines, xy, cells, edge_cells, cell, slope, black, x0, y0, scale):  # type: ignore[no-untyped-def]
    contrasts = edge_contrasts(lines, xy, cells, edge_cells, cell, slope)
    weights, room = unmixing(lines, contrasts, xy, cells, edge_cells, cell, black, x0, y0, scale)
    return contrasts, weights, room


def cleared(
    view: Sight, mesh: Topology, fit: Fit, lines: NDArray[np.float64], beside: Across
) -> tuple[Fit, Across]:
    """The fit with the blur that some of the gridlines show, and its levels without what that brings into the middle of
    a cell from its neighbours."""
    shown = view.image, lines, beside.weights, beside.room
    sigma, share, usual = _bleeding(*shown, fit.xy, mesh.cells, USUAL_SIGMA_PX / view.scale)
    fit = fit._replace(sigma=sigma)
    if usual > BLEEDING:
        fit = fit._replace(levels=unbled(fit.levels, mesh.cell_color, share, usual))
        beside = across(view, mesh, fit, lines)
    return fit, beside


@compiled
def _bleeding(image, lines, weights, room, xy, cells, assumed):  # type: ignore[no-untyped-def]
    """The blur, px; and what it makes of neighbours in the cells' means, as ``bled`` tells it."""
    sigma = profile_blur(image, lines, weights, room, BLUR_EDGES)
    sigma = max(sigma, MIN_SIGMA_PX) if np.isfinite(sigma) else BLIND_SIGMA_PX
    share, usual = bled(xy, cells, sigma, assumed)
    return sigma, share, usual
