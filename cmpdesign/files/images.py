"""Reading of image files as arrays, and writing of PNG."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError

SMALLEST_PX = 16

Image = NDArray[np.uint8] | NDArray[np.uint16]


class ImageFileError(CmpDesignError, ValueError):
    """A file that is not a color image of sufficient size."""


def read_image(path: str | Path, *, gray: bool = False) -> Image:
    """Read the pixels of an image file.

    An alpha channel is dropped. A rotation in EXIF is not applied, because the sensor's pixels are measured.

    Args:
        path: the file.
        gray: grayscale images are read, too; their three channels are equal.

    Returns:
        (H, W, 3) uint8 or uint16, BGR.

    Raises:
        ImageFileError: the file cannot be read, is no image, has one channel (unless ``gray``), has other than 8
            or 16 bits, or is smaller than 16 x 16 pixels.
    """
    import cv2

    path = Path(path)
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise ImageFileError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})"
        ) from None
    if not data:
        raise ImageFileError(f"{path}: is empty; expected an image")
    try:
        pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # OpenCV refuses to decode: too many pixels, or an unknown type
        pixels = None
    if pixels is None:
        raise ImageFileError(
            f"{path}: is not an image that can be read; expected PNG, JPEG, TIFF, BMP or WebP"
        )
    return _to_bgr(pixels, path, gray)


def _to_bgr(pixels: NDArray[Any], path: Path, gray: bool) -> Image:
    height, width = pixels.shape[:2]
    channels = pixels.shape[2] if pixels.ndim == 3 else 1
    if height < SMALLEST_PX or width < SMALLEST_PX:
        raise ImageFileError(
            f"{path}: is {width} x {height} px; expected at least {SMALLEST_PX} x {SMALLEST_PX} px"
        )
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ImageFileError(
            f"{path}: has pixels of type {pixels.dtype}; expected 8 or 16 bits, save it as PNG"
        )
    if channels == 1 and gray:
        return np.ascontiguousarray(np.repeat(pixels.reshape(height, width, 1), 3, axis=2))
    if channels < 3:
        raise ImageFileError(f"{path}: is a grayscale image; a multicolor pattern needs color (3 channels)")
    return np.ascontiguousarray(pixels[:, :, :3])


def to_png(pixels: Image) -> bytes:
    """Encode a (H, W, 3) BGR image as PNG."""
    import cv2

    return bytes(cv2.imencode(".png", pixels)[1])
