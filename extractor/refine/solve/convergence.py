"""The error that the last step by synthesis leaves."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled

REMAINING_SHARE = 1.0  # of a step, per blur, that another step would still correct
MAX_REMAINING_SHARE = 0.5  # of a step, at most
# Where blur is wide a step leaves as much of a usual one as the square of blur over edge, times
WIDE_BLUR_REMAINDER = 20.0
MEAN_OVER_MEDIAN = 1.44  # of squares


@compiled
def convergence_covariance(shift, sigma, remaining_share):  # type: ignore[no-untyped-def]
    """The covariance of the error that the last step left.

    The drawing responds less than linearly to shifts of the size of the blur.

    Args:
        shift: (M, 2) px, the last step.
        sigma: the blur, px.
        remaining_share: share of a usual step that is left in any case.

    Returns:
        (M, 2, 2) px^2.
    """
    out, square = np.zeros((shift.shape[0], 2, 2)), np.empty(shift.shape[0])
    for m in range(shift.shape[0]):
        x, y = shift[m, 0], shift[m, 1]
        square[m] = x * x + y * y
        share = min(REMAINING_SHARE * np.sqrt(square[m]) / sigma, MAX_REMAINING_SHARE)
        out[m, 0, 0], out[m, 1, 1] = (share * x) ** 2, (share * y) ** 2
        out[m, 0, 1] = out[m, 1, 0] = share * share * x * y
    if remaining_share > 0.0:
        variance = 0.5 * min(remaining_share, 1.0) ** 2 * MEAN_OVER_MEDIAN * np.nanmedian(square)
        out[:, 0, 0] += variance
        out[:, 1, 1] += variance
    return out
