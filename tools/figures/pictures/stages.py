"""The results of the extractor's stages for the pressed sample."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.draw import draw_stages

from .sample import SIZE, sample

Picture = NDArray[np.uint8]

# The shown part of the frame.
WINDOW_PX = (150, 75, 410, 270)  # left, top, right, bottom
WIDTH_PX = 520


def figures() -> dict[str, bytes]:
    """File name -> PNG."""
    shown = sample()
    pictures = draw_stages(shown.pressed_image, shown.reference, shown.pressed)
    found = {"image": shown.pressed_image, **pictures}
    return {f"stage-{name}.png": _png(_small(picture)) for name, picture in found.items()}


def _small(picture: Picture) -> Picture:
    scale = picture.shape[1] // SIZE[0]
    left, top, right, bottom = (scale * side for side in WINDOW_PX)
    cropped = picture[top:bottom, left:right]
    if cropped.shape[1] < WIDTH_PX:
        whole_number = WIDTH_PX // cropped.shape[1]
        return np.repeat(np.repeat(cropped, whole_number, axis=0), whole_number, axis=1)
    return _reduced(cropped, WIDTH_PX)


def _reduced(picture: Picture, width: int) -> Picture:
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _png(picture: Picture) -> bytes:
    """Colors in steps of 8, which are invisible in a drawing and compress better as PNG."""
    stepped = (picture // 8 * 8 + 4).astype(np.uint8)
    return bytes(cv2.imencode(".png", stepped, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1])
