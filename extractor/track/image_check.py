"""The check of predicted cells by the image: a cell must show its own ink inside and none of it across its edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import track as native
from extractor.image.response import ResponseTables, decode_values
from extractor.track.warm_tables import WarmTables

UNSEEN, CONTRADICTED, CONFIRMED = range(3)  # verdicts on a cell; as in native/track/image_check.hpp


class CellCheck(NamedTuple):
    """The check of C predicted cells.

    Attributes:
        verdict: (C,) uint8, ``UNSEEN`` (outside the image or not predicted), ``CONTRADICTED`` or ``CONFIRMED``.
        cell_levels: (2, C, 3) float64 BGR, each visible cell's ink level minus the black around the cell, and this
            black; NaN where unseen.
        white_count: number of edges of colored cells across which the white cell is bright, as in the layout.
        white_missing_count: number of edges across which the white cell is not bright.
        white_elsewhere_count: number of edges across which a black cell is as bright as white.
    """

    verdict: NDArray[np.uint8]
    cell_levels: NDArray[np.float64]
    white_count: int
    white_missing_count: int
    white_elsewhere_count: int


def check_cells(
    image: NDArray[np.uint8],
    corner_px: NDArray[np.float64],
    tables: WarmTables,
    levels_before: NDArray[np.float64] | None,
) -> CellCheck:
    """Compare predicted cells with the image, and their inks with those in the previous frame.

    Args:
        image: (H, W, 3) uint8 BGR.
        corner_px: (C, 3, 2) predicted corners, NaN where not predicted.
        levels_before: (2, C, 3) ``CellCheck.cell_levels`` of the previous frame; None: inks are not compared.
    """
    compare = levels_before is not None
    before = np.zeros((len(tables.ink), 3)) if levels_before is None else levels_before[0]
    return native.check_cells(np.ascontiguousarray(image), corner_px, tables, before, compare)


def light_levels(cell_levels: NDArray[np.float64], response: ResponseTables) -> NDArray[np.float64]:
    """(2, C, 3) the light of cells over black, and of their black, from ``CellCheck.cell_levels``."""
    light = response.light.astype(np.float64)
    black = decode_values(cell_levels[1], light)
    return np.stack([decode_values(cell_levels[0] + cell_levels[1], light) - black, black])
