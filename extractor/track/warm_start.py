"""What a frame leaves for the next one, and the warm start from it, which the image must prove."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import track as native
from extractor.image.pyramid import PyramidLevel
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.estimate import Appearance
from extractor.refine.synthesis.ink_levels import InkLevels
from extractor.track.warm_tables import WarmTables


class SeenCells(NamedTuple):
    """What a frame shows of its C colored cells.

    Attributes:
        levels: (2, C, 3) float64 BGR, each cell's ink level minus the black around the cell, and this black.
        light: (2, 3) float64, the mean light of the cells over black, and of their black, 0 to 255.
        ink_px: (C, 2) float64, px, the centroid of each cell's ink; NaN where there is too little ink.
    """

    levels: NDArray[np.float64]
    light: NDArray[np.float64]
    ink_px: NDArray[np.float64]


class TrackState(NamedTuple):
    """The last tracked frame, from which the next frame is predicted.

    Attributes:
        xy_px: (M, 2) float64, NaN where lost.
        known: (M,) bool, the measured markers.
        previous_px: (M, 2) float64, the markers of the previous frame; None where that frame was lost.
        cells: as the frame shows them.
        appearance: of the image, for refinement.
        mirrored: the image shows the pattern's back.
        expected_count: largest number of measured markers since the last cold start.
        frames_since_cold: number of frames since the last cold start.
        is_before_gap: the frame after this one was lost.
    """

    xy_px: NDArray[np.float64]
    known: NDArray[np.bool_]
    previous_px: NDArray[np.float64] | None
    cells: SeenCells
    appearance: Appearance
    mirrored: bool
    expected_count: int
    frames_since_cold: int
    is_before_gap: bool = False


class WarmStart(NamedTuple):
    """A proved warm start.

    Attributes:
        places: the markers before refinement.
        cells: as this frame shows them; of those that are not proved, the levels of the previous frame.
        ink_levels: those of the previous frame's appearance, in the light of this frame.
        by_rim: the white cell is hidden, and the rim proved the numbering.
    """

    places: InitialMarkers
    cells: SeenCells
    ink_levels: InkLevels
    by_rim: bool


def seen_cells(view: PyramidLevel, xy_px: NDArray[np.float64], tables: WarmTables) -> SeenCells:
    """What an image shows of the cells of numbered markers. Cells that are not seen have the mean levels of their ink.

    Args:
        view: the image at the scale of the next check.
        xy_px: (M, 2), NaN where lost.
    """
    return native.seen_cells(view, xy_px, tables)
