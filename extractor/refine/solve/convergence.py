"""The remaining error after the last step by synthesis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import solve as native
from extractor.refine.solve.fisher_information import Information


class StepRemainder(NamedTuple):
    """A step of M markers, and the error that the step leaves.

    Attributes:
        shift: (M, 2) px, the step.
        cov_px2: (M, 2, 2) px^2, the covariance of the remaining error; NaN where unknown.
        error: RMS of all known markers, in standard deviations of one axis; 0 where none is known.
    """

    shift: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    error: float


def step_remainder(
    measured: NDArray[np.float64],
    drawn: NDArray[np.float64],
    last: NDArray[np.float64],
    sigma: float,
    remaining_share: float,
    information: Information,
) -> StepRemainder:
    """The remaining error after the last step.

    The drawing responds less than linearly to shifts of the size of the blur. A marker whose steps shrink slowly is as
    far from its place as the steps that would follow (a geometric series).

    Args:
        measured, drawn: (M, 2) px, the markers after the step and before.
        last: (M, 2) px, the step before, NaN where there was none.
        sigma: the blur, px.
        remaining_share: share of a usual step that always remains.
        information: about the markers.
    """
    return native.step_remainder(measured, drawn, last, sigma, remaining_share, information.diagonal)
