"""The pattern drawn as light over black, and the residual along its gridlines.

Large arrays are kept from image to image: fresh memory costs more than writing to it.
"""

from __future__ import annotations

from typing import NamedTuple

from extractor.refine.measure.gridline_weights import LIMITS as WEIGHT_LIMITS
from extractor.refine.measure.gridline_weights import GridlineWeightLimits
from extractor.refine.synthesis.blur_bleed import LIMITS as BLEED_LIMITS
from extractor.refine.synthesis.blur_bleed import BleedLimits
from extractor.refine.synthesis.gridlines import LIMITS as GRIDLINE_LIMITS
from extractor.refine.synthesis.gridlines import GridlineLimits
from extractor.refine.synthesis.ink_levels import LIMITS as LEVEL_LIMITS
from extractor.refine.synthesis.ink_levels import InkLevelLimits
from extractor.refine.synthesis.pixel_rows import LIMITS as ROW_LIMITS
from extractor.refine.synthesis.pixel_rows import PixelRowLimits


class DrawingLimits(NamedTuple):
    """Limits of the drawing.

    Attributes:
        margin_sigma: blurs around the pattern that are drawn. Derived: 6e-5 of a blurred edge lies beyond.
        margin_px: px, added to that. Chosen.
        blur_step: of the blur, for derivatives of the levels. Chosen.
        gridlines: of the gridlines.
        levels: of the inks.
        bleed: of the neighbours' levels.
        rows: of the pixels along the gridlines.
        weights: of the gridlines.
    """

    margin_sigma: float = 4.0
    margin_px: float = 2.0
    blur_step: float = 0.02
    gridlines: GridlineLimits = GRIDLINE_LIMITS
    levels: InkLevelLimits = LEVEL_LIMITS
    bleed: BleedLimits = BLEED_LIMITS
    rows: PixelRowLimits = ROW_LIMITS
    weights: GridlineWeightLimits = WEIGHT_LIMITS


LIMITS = DrawingLimits()
