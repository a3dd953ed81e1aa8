"""Lamps: black bodies and colored LEDs, as linear sRGB light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.parts import RGB

WAVELENGTHS_NM = np.arange(380.0, 781.0, 5.0)
SECOND_RADIATION_CONSTANT = 1.4388e7  # nm K
# CIE 1931 color matching functions as sums of Gaussians with two widths (Wyman, Sloan and Shirley, JCGT 2013):
# weight, centre in nm, and the inverse widths below and above the centre in 1/nm.
MATCHING = (
    ((0.362, 442.0, 0.0624, 0.0374), (1.056, 599.8, 0.0264, 0.0323), (-0.065, 501.1, 0.0490, 0.0382)),
    ((0.821, 568.8, 0.0213, 0.0247), (0.286, 530.9, 0.0613, 0.0322)),
    ((1.217, 437.0, 0.0845, 0.0278), (0.681, 459.0, 0.0385, 0.0725)),
)
RGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)  # IEC 61966-2-1


def blackbody_rgb(temperature_k: float) -> RGB:
    """Linear sRGB light of a black body; the largest channel is 1. Colors outside sRGB are cut at 0."""
    wavelength = WAVELENGTHS_NM
    spectrum = wavelength**-5.0 / np.expm1(SECOND_RADIATION_CONSTANT / (wavelength * temperature_k))
    xyz = np.array([(spectrum * _matching_function(terms)).sum() for terms in MATCHING])
    return _normalised(np.maximum(RGB_FROM_XYZ @ xyz, 0.0))


def led_rgb(hue_deg: float, saturation: float) -> RGB:
    """Linear light of a colored LED; the largest channel is 1, the smallest is 1 - ``saturation``."""
    offsets = np.radians(hue_deg - np.array([0.0, 120.0, 240.0]))
    pure = 0.5 + 0.5 * np.cos(offsets)
    pure = (pure - pure.min()) / (pure.max() - pure.min())
    return _normalised(1.0 - saturation * (1.0 - pure))


def _matching_function(terms: tuple[tuple[float, ...], ...]) -> NDArray[np.float64]:
    total = np.zeros_like(WAVELENGTHS_NM)
    for weight, centre, below, above in terms:
        offset = WAVELENGTHS_NM - centre
        total += weight * np.exp(-0.5 * (offset * np.where(offset < 0, below, above)) ** 2)
    return total


def _normalised(rgb: NDArray[np.float64]) -> RGB:
    red, green, blue = (rgb / rgb.max()).tolist()
    return red, green, blue
