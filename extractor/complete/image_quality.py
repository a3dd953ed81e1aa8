"""The quality of an image, measured at the middles of cells: the properties that limit the reading."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import complete as native
from extractor.complete.row_breaks import RowBreak
from extractor.image.input import image_noise
from extractor.image.pyramid import PyramidLevel
from extractor.layout.reference import BLACK, COLORS, Reference
from extractor.quality import UNKNOWN, Quality

CELLS_PER_INK = 40  # that are sampled; chosen
# of the pixels by which the clipping of an image without numbers is measured; chosen, for time
CLIPPING_STRIDE = 4


class CellFigures(NamedTuple):
    """The figures at the middles of cells; the floats are NaN where no cell was measured.

    Attributes:
        contrast, clipping, evenness: as in ``Quality``.
        one, other: the two inks that differ least, as indices into ``COLORS``.
    """

    contrast: float
    one: int
    other: int
    clipping: float
    evenness: float


class SampledCells(NamedTuple):
    """The cells of a layout at which the quality is measured.

    Attributes:
        corners: (K, 3) int32 marker ids.
        color: (K,) uint8, red 0, green 1, blue 2, black 3.
    """

    corners: NDArray[np.int32]
    color: NDArray[np.uint8]


def sampled_cells(layout: Reference) -> SampledCells:
    """Up to ``CELLS_PER_INK`` cells of each color but white, spread over the layout."""
    chosen = _spread(layout.cell_color)
    return SampledCells(
        np.ascontiguousarray(layout.cell_corners[chosen]), np.ascontiguousarray(layout.cell_color[chosen])
    )


def _spread(color: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Up to ``CELLS_PER_INK`` of the cells of each color but white, at equal steps of their numbers."""
    parts = []
    for one in range(BLACK + 1):
        own = np.flatnonzero(color == one)
        parts.append(own[np.linspace(0, len(own) - 1, min(len(own), CELLS_PER_INK)).astype(np.intp)])
    return np.concatenate(parts)


def measure_quality_without_numbers(view: PyramidLevel, edge_px: float) -> Quality:
    """The quality of an image in which no cell was numbered.

    Args:
        view: the image at full scale.
        edge_px: the median side of cells that are neighbours as in a pattern; NaN without any.
    """
    sampled = view.image[::CLIPPING_STRIDE, ::CLIPPING_STRIDE]
    clipping = float((sampled.max(axis=2) >= native.CLIPPED_VALUE).mean())
    return replace(UNKNOWN, clipping=clipping, noise=image_noise(view.image), edge_px=edge_px)


def quality_of(found: CellFigures, noise: float, edge_px: float, blur_px: float, rows: RowBreak) -> Quality:
    """The quality of an image with numbered markers, noise and edge as in ``FinishedMarkers``."""
    inks = ("", "") if math.isnan(found.contrast) else (COLORS[found.one], COLORS[found.other])
    return Quality(
        blur_px,
        noise,
        found.contrast,
        inks,
        found.clipping,
        found.evenness,
        edge_px,
        rows.fault,
        rows.jump_px,
    )
