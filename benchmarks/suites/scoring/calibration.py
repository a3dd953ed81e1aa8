"""Calibration of stated covariances: squared errors over the covariance, three figures of many, their text.

For an error e and its stated covariance C, d2 = e' C^-1 e. If errors are normal with covariance C, d2 has a chi-square
distribution of two degrees of freedom: its mean is 2, its median 2 ln 2, and 0.27 % lie above 11.83. Markers of one
picture have errors in common (light, blur, estimated inks). Intervals are therefore bootstrapped over pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.pooled import Figure
from benchmarks.frame.table import TEXT, Table

BEYOND_D2 = 11.83  # three standard deviations in two dimensions
NOMINAL_BEYOND_SHARE = 0.0027
MEDIAN_D2 = 2 * math.log(2)  # of normal errors with the stated covariance
MIN_DETERMINANT_SHARE = 1e-12  # of the product of the variances; a covariance below it is singular
RESAMPLES, SEED = 2000, 20250101
INTERVAL_PERCENT = (2.5, 97.5)
COLUMNS = {
    "pictures": "d", "count": "d", "z": ".2f", "z, 95 %": ".2f", "median z": ".2f", "beyond": ".2%",
    "beyond, 95 %": ".2%", "singular": "d",
}  # fmt: skip
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A figure and its 95 % interval; the interval is NaN for fewer than two pictures."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Calibration:
    """Errors over their stated covariances, pooled over pictures. Figures are NaN without any d2.

    Attributes:
        pictures: pictures with at least one d2.
        count: number of d2, infinite ones included.
        singular: number of infinite d2, of covariances that are not positive definite.
        z: sqrt(mean d2 / 2) of finite d2; 1 is right, above 1 errors are larger than stated.
        median_z: sqrt(median d2 / (2 ln 2)), of all d2; 1 is right. Outliers do not move it.
        beyond: the share of d2 above ``BEYOND_D2``, infinite ones included; 0.0027 is right.
    """

    pictures: int
    count: int
    singular: int
    z: Estimate
    median_z: float
    beyond: Estimate


def squared_distances(error: NDArray[Any], covariance: NDArray[Any]) -> Floats:
    """(N,) d2 = e' C^-1 e of errors and stated covariances.

    Args:
        error: (N, 2), in px or any other unit.
        covariance: (N, 2, 2), symmetric, in the square of that unit.

    Returns:
        (N,) float64. NaN where the error or the covariance is not finite: such rows are not counted. Infinity where the
        covariance is not positive definite, or singular to 1e-12: no error has such a covariance.
    """
    error, covariance = np.asarray(error, np.float64), np.asarray(covariance, np.float64)
    known = np.isfinite(error).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    (x, y), cov = error[known].T, covariance[known]
    var_x, var_y, cov_xy = cov[:, 0, 0], cov[:, 1, 1], (cov[:, 0, 1] + cov[:, 1, 0]) / 2
    determinant = var_x * var_y - cov_xy**2
    definite = (var_x > 0) & (var_y > 0) & (determinant > MIN_DETERMINANT_SHARE * var_x * var_y)
    found = np.full(len(x), np.inf)
    np.divide(x**2 * var_y - 2 * x * y * cov_xy + y**2 * var_x, determinant, out=found, where=definite)
    d2 = np.full(len(error), np.nan)
    d2[known] = np.maximum(found, 0.0)
    return d2


def summarise(d2_of_pictures: Sequence[NDArray[Any]]) -> Calibration:
    """The figures of all pictures together.

    Args:
        d2_of_pictures: one array (N,) per picture, of ``squared_distances``. NaN is left out, as is a picture without
            any other value.
    """
    counted = [np.asarray(d2, np.float64)[~np.isnan(d2)] for d2 in d2_of_pictures]
    counted = [d2 for d2 in counted if len(d2)]
    if not counted:
        unknown = Estimate(math.nan, math.nan, math.nan)
        return Calibration(0, 0, 0, unknown, math.nan, unknown)
    every = np.concatenate(counted)
    finite = np.array([np.isfinite(d2).sum() for d2 in counted], dtype=np.float64)
    sums = np.array([d2[np.isfinite(d2)].sum() for d2 in counted])
    counts = np.array([len(d2) for d2 in counted], dtype=np.float64)
    beyond = np.array([(d2 > BEYOND_D2).sum() for d2 in counted], dtype=np.float64)
    half_mean = _ratio_of_sums(sums / 2, finite)
    return Calibration(
        pictures=len(counted),
        count=len(every),
        singular=int(np.isinf(every).sum()),
        z=Estimate(*(math.sqrt(value) for value in (half_mean.value, half_mean.low, half_mean.high))),
        median_z=math.sqrt(float(np.median(every)) / MEDIAN_D2),
        beyond=_ratio_of_sums(beyond, counts),
    )


def _ratio_of_sums(numerator: Floats, denominator: Floats) -> Estimate:
    """The sum of (P,) numerators over that of (P,) denominators, with its interval by bootstrap over pictures."""
    pictures, total = len(numerator), float(denominator.sum())
    value = float(numerator.sum()) / total if total else math.nan
    if pictures < 2 or not total:
        return Estimate(value, math.nan, math.nan)
    times = np.random.default_rng(SEED).multinomial(pictures, np.full(pictures, 1 / pictures), RESAMPLES)
    above, below = times @ numerator, times @ denominator
    low, high = np.percentile(above[below > 0] / below[below > 0], INTERVAL_PERCENT)
    return Estimate(value, float(low), float(high))


def calibration_values(calibration: Calibration) -> tuple[Any, ...]:
    """The values of a row, in the order of ``COLUMNS``."""
    z, beyond = calibration.z, calibration.beyond
    return (
        calibration.pictures, calibration.count, z.value, (z.low, z.high), calibration.median_z, beyond.value,
        (beyond.low, beyond.high), calibration.singular,
    )  # fmt: skip


def stated_columns(d2_of: Callable[[Any], NDArray[Any] | None]) -> dict[str, tuple[str, Figure]]:
    """Figures of results whose d2 a function gives; None for a result without any."""

    def column(spec: str, figure: Callable[[Calibration], Any]) -> tuple[str, Figure]:
        def of_results(results: Sequence[Any]) -> Any:
            return figure(summarise([d2 for one in results if (d2 := d2_of(one)) is not None]))

        return spec, of_results

    return {
        "z": column(".2f", lambda found: found.z.value),
        "median z": column(".2f", lambda found: found.median_z),
        "beyond": column(".2%", lambda found: found.beyond.value),
        "95 %": column(".1%", lambda found: (found.beyond.low, found.beyond.high)),
    }


def calibration_table(title: str, found: Mapping[str, Calibration]) -> Table:
    """A row for every name."""
    rows = [(name, *calibration_values(calibration)) for name, calibration in found.items()]
    return Table(title, {"errors over covariances": TEXT} | COLUMNS, rows)
