"""The appearance of an image before the first measurement: noise, levels of the inks, contrasts, and blur."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import markers as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.refine.estimate import Appearance, EdgeContrasts, Estimate
from extractor.refine.synthesis.blur_bleed import remove_bleed

DEFAULT_SIGMA_PX = 1.5  # assumed before the blur is measured; chosen
# of a neighbour's level in the middle of a cell, above which bleed is removed; chosen
MIN_CORRECTED_BLEED = 0.002


def initial_appearance(view: PyramidLevel, topology: Topology, xy: NDArray[np.float64]) -> Appearance:
    """The noise, and the levels from the middles of the cells at the markers (M, 2), px; the blur is 0: not known."""
    noise, levels = native.initial_appearance(view, topology, xy, DEFAULT_SIGMA_PX / view.scale)
    return Appearance(view.scale, 0.0, noise, levels, noise)


def update_edge_contrasts(
    view: PyramidLevel, topology: Topology, estimate: Estimate, lines: NDArray[np.float64]
) -> EdgeContrasts:
    """The contrasts across the gridlines (E, 8). Gridlines beside unknown cells are marked as not known in
    ``lines``.
    """
    where = lines, estimate.xy, topology
    return native.edge_contrasts(*where, estimate.levels, view)


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
    sigma, share, median_share = native.blur_and_bleed(
        view, lines, contrasts, estimate.xy, topology.cells, assumed
    )
    estimate = estimate._replace(sigma=sigma)
    if median_share > MIN_CORRECTED_BLEED:
        levels = remove_bleed(estimate.levels, topology.cell_color, share, median_share)
        estimate = estimate._replace(levels=levels)
        contrasts = update_edge_contrasts(view, topology, estimate, lines)
    return estimate, contrasts
