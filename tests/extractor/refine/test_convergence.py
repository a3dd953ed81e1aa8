"""The error that the last step leaves: the sum of the steps that would follow.

Inside: in an image this error cannot be told from noise.
"""

from __future__ import annotations

import numpy as np
import pytest

from extractor.refine.solve.convergence import convergence_covariance

NOWHERE = (np.nan, np.nan)


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
    cov = convergence_covariance(np.array([shift]), np.array([last]), sigma, 0.0)
    assert np.sqrt(np.trace(cov[0])) == pytest.approx(left_px, abs=1e-5)


def test_a_step_as_long_as_the_blur_leaves_half_of_itself() -> None:
    cov = convergence_covariance(np.array([(0.6, 0.8)]), np.array([NOWHERE]), 1.0, 0.0)
    assert np.allclose(cov[0], 0.25 * np.outer((0.6, 0.8), (0.6, 0.8)))
