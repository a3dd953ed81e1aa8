"""The remaining error after the last step by synthesis."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import solve as native
from extractor.refine.solve.fisher_information import Information

# With wide blur, the remaining share of a usual step is the square of blur over edge, times
WIDE_BLUR_REMAINDER = 20.0


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


def typical_move(shift: NDArray[np.float64], information: Information) -> float:
    """The typical move of markers in a step, in standard deviations of one axis; NaN where no marker is known.

    Args:
        shift: (M, 2) px, NaN where unknown.
        information: about the markers.
    """
    x, y = shift.T
    xx, xy, yy = information.diagonal.T
    square = xx * x * x + 2 * xy * x * y + yy * y * y
    known = square[square > 0]
    middle = known.size // 2
    return (
        math.sqrt(0.5 * LIMITS.mean_over_median * np.partition(known, middle)[middle])
        if known.size
        else math.nan
    )


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
