"""The remaining error after the last step by synthesis."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import solve as native
from extractor.refine.solve.fisher_information import Information

# The remaining share of a usual step is the square of blur over edge, times
BLUR_REMAINDER = 20.0


class ConvergenceLimits(NamedTuple):
    """Limits of the remaining error after the last step.

    Attributes:
        remaining_share: of a step, per blur, that another step would still correct. Chosen.
        max_remaining_share: of a step, at most. Chosen.
        max_shrinking: of a marker's last step over the step before, at most; the following steps would shrink by the
            same factor. Chosen: the following steps together are at most as long as the last one, because a factor from
            two steps is uncertain.
        mean_over_median: of squares, by which the median of the squared shifts becomes their mean. Derived: 1 / ln 2,
            of the sum of two normal squares.
    """

    remaining_share: float = 1.0
    max_remaining_share: float = 0.5
    max_shrinking: float = 0.5
    mean_over_median: float = 1.44


LIMITS = ConvergenceLimits()


def remaining_share(sigma: float, edge_px: float) -> float:
    """The share of a usual step that is left after the step, by blur and edge, px."""
    return BLUR_REMAINDER * (sigma / edge_px) ** 2


def convergence_covariance(
    shift: NDArray[np.float64], last: NDArray[np.float64], sigma: float, remaining_share: float
) -> NDArray[np.float64]:
    """The covariance of the remaining error after the last step.

    The drawing responds less than linearly to shifts of the size of the blur. A marker whose steps shrink slowly is as
    far from its place as the steps that would follow (a geometric series).

    Args:
        shift: (M, 2) px, the last step.
        last: (M, 2) px, the step before, NaN where there was none.
        sigma: the blur, px.
        remaining_share: share of a usual step that always remains.

    Returns:
        (M, 2, 2) px^2.
    """
    covariance: NDArray[np.float64] = native.convergence_covariance(
        shift, last, sigma, remaining_share, LIMITS
    )
    return covariance


def remaining_error(covariance: NDArray[np.float64], information: Information) -> float:
    """The remaining error, RMS of all known markers, in standard deviations of one axis; 0 where none is known.

    Args:
        covariance: (M, 2, 2) px^2, of the remaining error; NaN where unknown.
        information: about the markers.
    """
    xx, xy, yy = information.diagonal.T
    square = xx * covariance[:, 0, 0] + 2 * xy * covariance[:, 0, 1] + yy * covariance[:, 1, 1]
    known = square[np.isfinite(square)]
    return math.sqrt(0.5 * float(known.mean())) if known.size else 0.0


def typical_deviation(information: Information) -> float:
    """The deviation of one axis, px, that the information allows a typical marker; 0 without any."""
    traces = information.diagonal[:, 0] + information.diagonal[:, 2]
    return math.sqrt(2.0 / float(np.median(traces))) if traces.size else 0.0
