"""The sensor: exposure, shot and read noise, clipping, lifted black, and the Bayer mosaic with its demosaicing."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import Demosaicing, Sensor

Planes = NDArray[np.float32]
PEDESTAL = 1024  # of 65535: noise below zero light is kept until the demosaicing
RAW_SCALE = 60000.0  # of 65535: the largest light above the pedestal
# the place of red in row-major order of the 2 x 2 block, by phase
DEMOSAICINGS: dict[Demosaicing, tuple[int, ...]] = {
    "edge-aware": (
        cv2.COLOR_BayerRGGB2BGR_EA,
        cv2.COLOR_BayerGRBG2BGR_EA,
        cv2.COLOR_BayerGBRG2BGR_EA,
        cv2.COLOR_BayerBGGR2BGR_EA,
    ),
    "bilinear": (
        cv2.COLOR_BayerRGGB2BGR,
        cv2.COLOR_BayerGRBG2BGR,
        cv2.COLOR_BayerGBRG2BGR,
        cv2.COLOR_BayerBGGR2BGR,
    ),
}


def expose(planes: Planes, sensor: Sensor, gain_bgr: NDArray[np.float64], rng: np.random.Generator) -> Planes:
    """(3, H, W) the sensor's light after white balance, channels B, G, R; 1 is the largest light of the darkest gain.

    Cameras balance the mosaic before they interpolate it, so the gains are applied here.

    Args:
        planes: (3, H, W) light that falls on the sensor, channels B, G, R.
        sensor: the sensor.
        gain_bgr: (3,) the gains of the white balance.
        rng: the noise's random stream.
    """
    light = planes * np.float32(sensor.exposure) + np.float32(sensor.lifted_black)
    gain = np.asarray(gain_bgr, dtype=np.float32)
    if sensor.demosaicing is None:
        return _balanced(_noisy(light, sensor, rng), gain[:, None, None])
    channel = mosaic_channels(light.shape[1:], sensor.phase)
    mosaic = np.take_along_axis(light, channel[None], axis=0)[0]
    return demosaic(_balanced(_noisy(mosaic, sensor, rng), gain[channel]), sensor.demosaicing, sensor.phase)


def mosaic_channels(shape: tuple[int, ...], phase: int) -> NDArray[np.int64]:
    """(H, W): the channel of each pixel, 0 blue, 1 green, 2 red; ``phase`` is the place of red in each block."""
    row, column = np.indices(shape)
    red = (row % 2 == phase // 2) & (column % 2 == phase % 2)
    blue = (row % 2 != phase // 2) & (column % 2 != phase % 2)
    return np.asarray(np.where(red, 2, np.where(blue, 0, 1)))


def demosaic(mosaic: Planes, method: Demosaicing, phase: int) -> Planes:
    """(3, H, W) B, G, R light of a mosaic (H, W) of light, by OpenCV at 16 bits."""
    raw = np.clip(np.rint(mosaic * np.float32(RAW_SCALE) + np.float32(PEDESTAL)), 0, 65535).astype(np.uint16)
    image = cv2.demosaicing(raw, DEMOSAICINGS[method][phase]).astype(np.float32)
    return np.ascontiguousarray((image - np.float32(PEDESTAL)) / np.float32(RAW_SCALE)).transpose(2, 0, 1)


def _noisy(light: Planes, sensor: Sensor, rng: np.random.Generator) -> Planes:
    """Light with shot and read noise, clipped at 1."""
    noise = rng.standard_normal(light.shape, dtype=np.float32)
    electrons = np.maximum(light, 0) * np.float32(sensor.electrons)
    noise *= np.sqrt(electrons + np.float32(sensor.read_noise) ** 2)
    return np.asarray(
        np.minimum(light + noise / np.float32(sensor.electrons), np.float32(1.0)), dtype=np.float32
    )


def _balanced(light: Planes, gain: NDArray[np.float32]) -> Planes:
    return np.asarray(np.minimum(light * gain, np.float32(1.0)), dtype=np.float32)
