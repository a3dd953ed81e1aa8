"""The arrangement of products' pictures around the preview's drawing: tall pictures right of the drawing, others
below.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

# Least height of pictures right of the drawing, and width (about) of pictures below it.
RIGHT_PX, BELOW_PX = 1000, 300
GAP_PX, CAPTION_PX = 12, 26
_TEXT_BGR = (60, 52, 44)


def compose_pictures(drawing: Image, pictures: Mapping[str, Image], paper: tuple[int, int, int]) -> Image:
    """Compose a drawing and pictures into one picture.

    Args:
        drawing: (H, W, 3) uint8 BGR.
        pictures: name -> (H, W, 3) uint8 BGR; white becomes ``paper``.
        paper: BGR color of the ground.

    Returns:
        (H, W, 3) uint8 BGR.
    """
    tinted = {name: _on_paper(picture, paper) for name, picture in pictures.items()}
    tall = {name: picture for name, picture in tinted.items() if picture.shape[0] > picture.shape[1]}
    height = max(drawing.shape[0], RIGHT_PX if tall else 0)
    top = _picture_row([drawing, *(_scale_picture(p, height / p.shape[0]) for p in tall.values())], paper)
    below = [(name, picture) for name, picture in tinted.items() if name not in tall]
    columns = max(1, top.shape[1] // BELOW_PX)
    # An even number of columns keeps the two pictures of a part in one row.
    columns -= columns % 2 if columns > 1 else 0
    width = top.shape[1] // columns - GAP_PX
    rows = [top]
    for first in range(0, len(below), columns):
        captioned = [
            _caption_picture(name, picture, width, paper) for name, picture in below[first : first + columns]
        ]
        rows.append(_picture_row(captioned, paper))
    widest = max(row.shape[1] for row in rows)
    return np.concatenate([_pad_picture(row, row.shape[0] + GAP_PX, widest, paper) for row in rows])


def _on_paper(picture: Image, paper: tuple[int, int, int]) -> Image:
    """The picture multiplied by the paper's color (white becomes paper)."""
    return np.asarray(picture.astype(np.uint16) * np.array(paper) // 255, dtype=np.uint8)


def _caption_picture(name: str, picture: Image, width: int, paper: tuple[int, int, int]) -> Image:
    import cv2

    small = _scale_picture(picture, width / picture.shape[1])
    captioned = _pad_picture(small, small.shape[0] + CAPTION_PX, width + GAP_PX, paper)
    text, baseline = name.replace("-above", ", above").replace("-below", ", below"), small.shape[0] + 16
    origin = [GAP_PX, baseline]
    cv2.putText(captioned, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.5, _TEXT_BGR, 1, cv2.LINE_AA)
    return captioned


def _scale_picture(picture: Image, factor: float) -> Image:
    import cv2

    interpolation = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    size = [max(1, round(side * factor)) for side in picture.shape[1::-1]]
    return np.asarray(cv2.resize(picture, size, interpolation=interpolation), dtype=np.uint8)


def _picture_row(pictures: list[Image], paper: tuple[int, int, int]) -> Image:
    height = max(picture.shape[0] for picture in pictures)
    return np.concatenate([_pad_picture(p, height, p.shape[1], paper) for p in pictures], axis=1)


def _pad_picture(picture: Image, height: int, width: int, paper: tuple[int, int, int]) -> Image:
    result = np.empty((height, width, 3), np.uint8)
    result[:] = paper
    result[: picture.shape[0], : picture.shape[1]] = picture
    return result
