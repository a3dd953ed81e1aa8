"""Inks under a lamp as a camera shows them, by spectra: lamp, reflectance, sensitivity, color matrix.

An ink's reflectance spectrum is the sum of three smooth bands, weighted by its linear sRGB reflectance. Sensitivities
are Gaussian; the color matrix reproduces linear sRGB of such inks under daylight of 6,500 K, and is kept for all lamps,
as is the white balance. Under another lamp the matrix leaves channels below zero: they are cut, as in a camera.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.camera.lamps import SECOND_RADIATION_CONSTANT, WAVELENGTHS_NM
from benchmarks.suites.camera.parts import RGB, Inks

Spectrum = NDArray[np.float64]  # over WAVELENGTHS_NM
DAYLIGHT_K = 6500.0
BANDS_NM = ((580.0, 12.0), (495.0, 12.0))  # middle and width of the steps between the bands red, green, blue
SENSITIVITIES_NM = ((605.0, 35.0), (535.0, 40.0), (455.0, 30.0))  # middle and sigma of R, G, B
LEDS_NM = ((625.0, 9.0), (525.0, 15.0), (465.0, 11.0))  # middle and sigma of LEDs as they are sold


def blackbody(temperature_k: float) -> Spectrum:
    """The spectrum of a black body."""
    wavelength = WAVELENGTHS_NM
    return np.asarray(wavelength**-5.0 / np.expm1(SECOND_RADIATION_CONSTANT / (wavelength * temperature_k)))


def led_triple(power: RGB) -> Spectrum:
    """The spectrum of a red, a green and a blue LED of these powers."""
    return np.asarray(sum(p * _gaussian(*led) for p, led in zip(power, LEDS_NM, strict=True)))


def inks_under(lamp: Spectrum, inks: Inks) -> Inks:
    """The inks' linear light (R, G, B) in a camera's picture under a lamp; the largest channel of white is as it was.

    The camera's exposure adapts, its colors do not.
    """
    color_matrix = np.linalg.inv(_sensor_matrix(blackbody(DAYLIGHT_K)))
    seen = color_matrix @ _sensor_matrix(lamp)
    light = {field.name: np.maximum(seen @ getattr(inks, field.name), 0.0) for field in fields(inks)}
    gain = max(inks.white) / light["white"].max()
    return Inks(**{name: _rgb(gain * value) for name, value in light.items()})


def _sensor_matrix(lamp: Spectrum) -> NDArray[np.float64]:
    """(3, 3): the light of each channel of the sensor, by each band of reflectance."""
    bands = _bands()
    return np.array(
        [[(_gaussian(*channel) * lamp * band).sum() for band in bands] for channel in SENSITIVITIES_NM]
    )


def _bands() -> NDArray[np.float64]:
    """(3, N): smooth bands red, green, blue that add up to 1."""
    (red_nm, red_width), (blue_nm, blue_width) = BANDS_NM
    red = 1.0 / (1.0 + np.exp(-(WAVELENGTHS_NM - red_nm) / red_width))
    blue = 1.0 / (1.0 + np.exp((WAVELENGTHS_NM - blue_nm) / blue_width))
    return np.stack([red, 1.0 - red - blue, blue])


def _gaussian(middle_nm: float, sigma_nm: float) -> Spectrum:
    return np.asarray(np.exp(-0.5 * ((WAVELENGTHS_NM - middle_nm) / sigma_nm) ** 2))


def _rgb(values: NDArray[np.float64]) -> RGB:
    red, green, blue = values.tolist()
    return red, green, blue
