"""The development of a picture: white balance, sharpening, tone mapping, tone curve, encoding, compression."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import Development
from extractor.image.response import encode_light, light_of_values

Planes = NDArray[np.float32]
SHARPENING_SIGMA_PX = 1.0
TONE_SIGMA_PX = 25.0  # of the surroundings that local tone mapping compares a pixel with
DARKEST_TONE = 0.02  # of white, below which surroundings are not brightened further


def balance_gains(development: Development, lamp_bgr: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) gains B, G, R of the white balance for lamps of a mean color (3,); the smallest is 1."""
    gain = lamp_bgr**-development.balance * np.exp(np.asarray(development.balance_error[::-1]))
    return np.asarray(gain / gain.min())


def develop(planes: Planes, development: Development) -> NDArray[np.uint8]:
    """The picture (H, W, 3) uint8 BGR of balanced linear light (3, H, W)."""
    light = np.ascontiguousarray(planes.transpose(1, 2, 0))
    if development.sharpening:
        smooth = cv2.GaussianBlur(light, (0, 0), SHARPENING_SIGMA_PX)
        light = light + np.float32(development.sharpening) * (light - smooth)
    if development.tone_mapping:
        light = tone_mapped(light, development.tone_mapping)
    values = encode_light(255.0 * np.clip(light, 0, 1), light_of_values("srgb"))
    if development.s_curve:
        values = s_curved(values, development.s_curve)
    image = np.clip(np.rint(values), 0, 255).astype(np.uint8)
    if development.jpeg_quality is None:
        return image
    return compressed(image, development.jpeg_quality, chroma_420=development.jpeg_420)


def tone_mapped(light: Planes, strength: float) -> Planes:
    """Light (H, W, 3) after local tone mapping: dark surroundings are brightened and bright ones darkened.

    The gain is the surroundings' brightness, relative to that of the whole picture, to the power of -``strength``.
    """
    gray = light.mean(axis=2)
    around = np.maximum(cv2.GaussianBlur(gray, (0, 0), TONE_SIGMA_PX), DARKEST_TONE)
    gain = (around / max(float(gray.mean()), DARKEST_TONE)) ** np.float32(-strength)
    return np.asarray(light * gain[:, :, None], dtype=np.float32)


def s_curved(values: NDArray[np.float64], strength: float) -> NDArray[np.float64]:
    """Encoded values 0 to 255 after an S-shaped tone curve: dark ones darker, bright ones brighter."""
    share = values / 255.0
    return np.asarray(255.0 * ((1 - strength) * share + strength * share**2 * (3 - 2 * share)))


def compressed(image: NDArray[np.uint8], quality: int, *, chroma_420: bool) -> NDArray[np.uint8]:
    """The picture (H, W, 3) uint8 BGR after JPEG, with colors at half (4:2:0) or full (4:4:4) resolution."""
    factor = cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420 if chroma_420 else cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor]
    _, coded = cv2.imencode(".jpg", image, options)
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
