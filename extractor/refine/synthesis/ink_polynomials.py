"""Polynomials of third degree over an image, fitted robustly to the levels of one ink's cells."""

from __future__ import annotations

from typing import NamedTuple


class PolynomialLimits(NamedTuple):
    """Limits of a robust fit.

    Attributes:
        outlier_tolerance: deviations of the scatter, beyond which a cell is an outlier. Chosen.
        min_outlier_misfit: gray levels^2, added to that tolerance. Chosen.
        max_fit_rounds: rounds of weighting. Chosen.
        falling_variance: rounds end when the scatter falls to no less than this share. Chosen.
        saturation_per_px: 1/px; a cell of n pixels weighs n / (1 + saturation_per_px n) before the first round. Chosen.
        weight_reach: in units of the scatter, the misfit where a cell's weight is a quarter. Chosen.
        expected_factor: of the variance expected from noise, the part that is no scatter of the cells. Chosen.
        ridge: added to the diagonal of the normal equations, in units of the cells' total weight. Chosen.
    """

    outlier_tolerance: float = 4.0
    min_outlier_misfit: float = 4.0
    max_fit_rounds: int = 10
    falling_variance: float = 0.9
    saturation_per_px: float = 0.1
    weight_reach: float = 6.0
    expected_factor: float = 1.15
    ridge: float = 1e-6


LIMITS = PolynomialLimits()
