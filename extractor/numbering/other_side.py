"""A pattern seen from another side than stated: the hues of its inks may give the cause.

A pattern whose red and blue are swapped, as in an RGB image taken for BGR, is its own mirror image, but its inks then
have other hues: a hue h becomes 240 - h degrees.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.numbering.lattice_walk import Numbering
from extractor.numeric.bilinear import fill_patch_mean
from extractor.result import Reason

SAMPLE_RADIUS = 0.1  # of the root of a cell's area, over which its color is averaged; chosen
SWAPPED_HUES_DEG = 240.0  # the sum of a hue and of that with red and blue swapped; derived
MAX_HUE_ERROR_DEG = 12.0  # of the inks' hues from the palette's; colored light moves them farther. Chosen
MAX_HUE_ERROR_RATIO = 0.5  # of the smaller error to the larger one; chosen


def other_side_reason(
    image: NDArray[np.uint8], cells: Cells, numbering: Numbering, palette_hues_deg: NDArray[np.float64]
) -> Reason:
    """The cause of a view of another side than stated.

    Args:
        image: (H, W, 3) uint8 BGR, at full scale.
        cells, numbering: the cells at full scale and their numbers.
        palette_hues_deg: (3,) of the layout's red, green and blue.
    """
    inks = np.array(
        [_median_color(image, cells, (numbering.cell >= 0) & (cells.ink == k)) for k in (1, 2, 3)]
    )
    return reason_by_hues(inks, palette_hues_deg)


def reason_by_hues(inks: NDArray[np.float64], palette_hues_deg: NDArray[np.float64]) -> Reason:
    """The reason by the inks' colors.

    Args:
        inks: (3, 3) R, G, B of the inks that look like red, green and blue; NaN where unknown.
        palette_hues_deg: (3,) of the layout's red, green and blue.
    """
    hues = _hues_deg(inks)
    as_is = _hue_error_deg(hues, palette_hues_deg)
    # the ink that looks like red is then blue
    swapped = _hue_error_deg(SWAPPED_HUES_DEG - hues[::-1], palette_hues_deg)
    if not min(as_is, swapped) < min(MAX_HUE_ERROR_DEG, MAX_HUE_ERROR_RATIO * max(as_is, swapped)):
        return Reason.OTHER_SIDE
    return Reason.MIRRORED if as_is < swapped else Reason.SWAPPED_CHANNELS


def _hues_deg(inks: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) the hues of colors (3, 3) R, G, B."""
    return cv2.cvtColor(inks[None].astype(np.float32), cv2.COLOR_RGB2HSV)[0, :, 0].astype(np.float64)


def _hue_error_deg(hues_deg: NDArray[np.float64], palette_hues_deg: NDArray[np.float64]) -> float:
    """The largest distance of a hue from the palette's, on the circle."""
    return float(np.abs((hues_deg - palette_hues_deg + 180.0) % 360.0 - 180.0).max())


def _median_color(image: NDArray[np.uint8], cells: Cells, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(3,) the median R, G, B at the middles of the chosen cells."""
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    colors, own = [], np.empty(3)
    for i in np.flatnonzero(chosen):
        radius = SAMPLE_RADIUS * float(np.sqrt(cells.area_px[i]))
        if fill_patch_mean(flat, height, width, cells.center_px[i, 0], cells.center_px[i, 1], radius, own):
            colors.append(own[::-1].copy())
    return np.median(colors, axis=0) if colors else np.full(3, np.nan)
