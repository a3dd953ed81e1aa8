"""Input images: conversion of any common kind to 8-bit BGR, checks, and an estimate of the noise."""

from __future__ import annotations

from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native
from extractor.errors import ImageError

Channels = Literal["bgr", "rgb"]  # the order of an image's colors

MIN_SIDE_PX = 16  # of an image


def convert_to_bgr(image: NDArray[Any], channels: Channels = "bgr") -> NDArray[np.uint8] | None:
    """The image as contiguous (H, W, 3) uint8 BGR, or None when it has no color.

    16-bit images of either byte order are scaled to 8 bits (value / 257, rounded). The alpha of BGRA is dropped. A
    grayscale image ((H, W) or (H, W, 1)) has no color. ``channels`` is the order of the image's colors.

    Raises:
        ImageError: not an array, a float or signed type, another shape, or a side below 16 px.
    """
    if not isinstance(image, np.ndarray):
        raise ImageError(
            f"image is {type(image).__name__}; give a numpy array (H, W, 3) of uint8 in BGR order"
        )
    if image.dtype.kind != "u" or image.dtype.itemsize > 2:
        raise ImageError(
            f"image has dtype {image.dtype}; give uint8 or uint16 (scale float images to 0..255 first)"
        )
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3, 4)):
        raise ImageError(
            f"image has shape {image.shape}; give (H, W, 3) BGR, (H, W, 4) BGRA or (H, W) grayscale"
        )
    if min(image.shape[:2]) < MIN_SIDE_PX:
        raise ImageError(
            f"image is {image.shape[1]} x {image.shape[0]} px; give at least {MIN_SIDE_PX} px a side"
        )
    if image.ndim == 2 or image.shape[2] == 1:
        return None
    color = in_native_order(image[:, :, :3])
    if color.dtype == np.uint16:
        color = cv2.convertScaleAbs(color, alpha=1 / 257)
    if channels == "rgb":
        return np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2BGR))
    return np.ascontiguousarray(color, dtype=np.uint8)


def in_native_order(image: NDArray[Any]) -> NDArray[Any]:
    """The image in the byte order of this machine: OpenCV does not convert the byte order."""
    return image if image.dtype.isnative else image.astype(image.dtype.newbyteorder("="))


def image_noise(image: NDArray[np.uint8]) -> float:
    """Standard deviation of the noisiest channel of an image (H, W, 3), gray levels of 255; needs no pattern."""
    return native.channel_noise(np.ascontiguousarray(image.transpose(2, 0, 1)))


def estimate_noise(image: NDArray[np.uint8], xy: NDArray[np.float64], cells: NDArray[np.int32]) -> float:
    """Standard deviation of a channel's noise in gray levels (Immerkaer 1996, with a median for robustness).

    The Laplacian-like mask [1 -2 1; -2 4 -2; 1 -2 1] ignores gradients; its response to noise is 6 sigma. It is applied
    to all channels in the middles of cells, where no pixel is clipped.

    Args:
        image: (H, W, 3) uint8.
        xy: (M, 2) markers, px.
        cells: (K, 3) marker ids of the cells' corners.

    Returns:
        NaN where no cell lies within the image.
    """
    cells = np.ascontiguousarray(cells, dtype=np.int32)
    return float(native.estimate_noise(image, np.ascontiguousarray(xy), cells))
