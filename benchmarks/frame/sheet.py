"""Sheets of small pictures with captions, for pages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
TILE_PX, LINE_PX, QUALITY = (208, 156), 14, 72
DOT_PX = 2  # radius
PAPER_BGR, TEXT_BGR = (255, 255, 255), (54, 47, 43)


class Tile(NamedTuple):
    """A picture of ``TILE_PX`` (width, height), and the lines below."""

    image: Image
    lines: Sequence[str]


def draw_sheet(tiles: Sequence[Tile], columns: int, lines: int, text_scale: float) -> bytes:
    """JPEG of the tiles in rows; one empty row without any."""
    blank = np.full((TILE_PX[1] + 4 + LINE_PX * lines, TILE_PX[0], 3), PAPER_BGR, dtype=np.uint8)
    drawn = []
    for tile in tiles:
        drawn.append(blank.copy())
        drawn[-1][: TILE_PX[1]] = tile.image
        for number, text in enumerate(tile.lines):
            place = (3, TILE_PX[1] + 12 + LINE_PX * number)
            cv2.putText(
                drawn[-1], text, place, cv2.FONT_HERSHEY_SIMPLEX, text_scale, TEXT_BGR, 1, cv2.LINE_AA
            )
    drawn += [blank] * (-len(drawn) % columns or (0 if drawn else columns))
    rows = [np.hstack(drawn[first : first + columns]) for first in range(0, len(drawn), columns)]
    return bytes(cv2.imencode(".jpg", np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])


def draw_dots(image: Image, places: Iterable[NDArray[np.float64]], bgr: tuple[int, int, int]) -> None:
    """Draw a dot at each place (2,) px."""
    for x, y in places:
        place = (round(16 * float(x)), round(16 * float(y)))
        cv2.circle(image, place, 16 * DOT_PX, bgr, -1, cv2.LINE_AA, 4)
