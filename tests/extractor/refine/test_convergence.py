"""The error that the last step leaves: the sum of the steps that would follow.

Inside: in an image this error cannot be told from noise.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from extractor.refine.solve.convergence import step_remainder
from extractor.refine.solve.fisher_information import Information

NOWHERE = (np.nan, np.nan)


def left_px2(shift: tuple[float, float], last: tuple[float, float], sigma: float) -> NDArray[np.float64]:
    """(2, 2) px^2, the covariance of what a step leaves of one marker; the step before was ``last``."""
    markers = np.array([shift]), np.zeros((1, 2)), np.array([last])
    return step_remainder(*markers, sigma, 0.0, Information(np.ones((1, 3)), np.zeros((0, 4)))).cov_px2[0]


@pytest.mark.parametrize(
    ("shift", "last", "left_px"),
    [
        ((0.01, 0.0), (0.04, 0.0), 0.01 / 3),  # 1/4 + 1/16 + ... of the last step
        ((0.0, 0.01), (0.0, 0.02), 0.01),
        ((0.01, 0.0), (0.005, 0.0), 0.01),  # a longer step than the one before: as if it were half as long
        ((0.01, 0.0), (-0.02, 0.0), 0.0),  # back and forth
        ((0.01, 0.0), NOWHERE, 0.0),
    ],
)
def test_steps_that_shrink_slowly_leave_an_error(
    shift: tuple[float, float], last: tuple[float, float], left_px: float
) -> None:
    sigma = 1e3  # so that the response to shifts is linear
    assert np.sqrt(np.trace(left_px2(shift, last, sigma))) == pytest.approx(left_px, abs=1e-5)


def test_a_step_as_long_as_the_blur_leaves_half_of_itself() -> None:
    cov = left_px2((0.6, 0.8), NOWHERE, 1.0)
    assert np.allclose(cov, 0.25 * np.outer((0.6, 0.8), (0.6, 0.8)))
