"""The pattern drawn as light over black, and the residual along its gridlines.

Large arrays are kept from image to image: fresh memory costs more than writing to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.image.pyramid import PyramidLevel
from extractor.layout.topology import Topology
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_weights import LIMITS as WEIGHT_LIMITS
from extractor.refine.measure.gridline_weights import GridlineWeightLimits, pattern_box
from extractor.refine.synthesis.blur_bleed import LIMITS as BLEED_LIMITS
from extractor.refine.synthesis.blur_bleed import BleedLimits
from extractor.refine.synthesis.gridlines import LIMITS as GRIDLINE_LIMITS
from extractor.refine.synthesis.gridlines import GridlineLimits
from extractor.refine.synthesis.ink_levels import LIMITS as LEVEL_LIMITS
from extractor.refine.synthesis.ink_levels import InkLevelLimits, InkLevels
from extractor.refine.synthesis.pixel_rows import LIMITS as ROW_LIMITS
from extractor.refine.synthesis.pixel_rows import PixelRowLimits

MARGIN_SIGMA = 4.0  # blurs around the pattern that are drawn; derived: 6e-5 of a blurred edge lies beyond


class DrawingLimits(NamedTuple):
    """Limits of the drawing.

    Attributes:
        blur_step: of the blur, for derivatives of the levels. Chosen.
        gridlines: of the gridlines.
        levels: of the inks.
        bleed: of the neighbours' levels.
        rows: of the pixels along the gridlines.
        weights: of the gridlines.
    """

    blur_step: float = 0.02
    gridlines: GridlineLimits = GRIDLINE_LIMITS
    levels: InkLevelLimits = LEVEL_LIMITS
    bleed: BleedLimits = BLEED_LIMITS
    rows: PixelRowLimits = ROW_LIMITS
    weights: GridlineWeightLimits = WEIGHT_LIMITS


LIMITS = DrawingLimits()


class Synthesis(NamedTuple):
    """The pattern as it is drawn, and the sums along its gridlines.

    Attributes:
        xy, lines, bend: the markers (M, 2) px, the gridlines (E, 8) and their bending (E, 2) px.
        sides, contrasts: (E, 6) and (E, 3), as ``GridlineSides`` and ``value_contrasts`` give them.
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
    *drawn, levels, edge_px = native.draw_pattern(
        view, topology, picture, estimate, estimate.levels, box, LIMITS
    )
    lines, sides, contrasts, added, sums = drawn
    corrected = InkLevels(*levels)
    where = estimate.xy, lines, estimate.bend
    return Synthesis(*where, sides, contrasts, added, sums, corrected, estimate.sigma, edge_px)
