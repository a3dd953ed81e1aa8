"""The modulus from weights."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign import CmpDesignError
from cmpdesign.contact.force_scale import fit_force_scale, parse_weights

TEXT = "frame,mass_g\n0,20\n1,50\n2,100\n3,100\n4,200\n"


def test_scale_and_bias_are_recovered_within_their_deviations() -> None:
    weights = parse_weights(TEXT, "weights.csv")
    true = weights.mass_g * 9.80665e-3
    random = np.random.default_rng(2)
    errors = []
    for _ in range(200):
        sigma = 0.02 * true
        read = (true + 0.03) * 0.8 + 0.8 * sigma * random.normal(size=len(true))
        found = fit_force_scale(weights, read, (0.8 * sigma) ** 2, 0.3)
        errors.append(
            ((found.young_mpa - 0.375) / found.young_sigma_mpa, (found.bias_n - 0.03) / found.bias_sigma_n)
        )
    # the deviation never falls below the stated one, so its errors are at most one
    assert 0.5 < np.sqrt(np.square(errors).mean()) < 1.1
    assert found.weights == 4


@pytest.mark.parametrize(
    "text", ["mass,frame\n", "frame,mass_g\nx,1\n", "frame,mass_g\n0,-1\n", "frame,mass_g\n0\n", ""]
)
def test_bad_files_of_weights_are_refused(text: str) -> None:
    with pytest.raises(CmpDesignError, match="weights\\.csv"):
        parse_weights(text, "weights.csv")


def test_too_few_weights_and_falling_forces_are_refused() -> None:
    weights = parse_weights(TEXT, "weights.csv")
    read = weights.mass_g * 0.01
    with pytest.raises(CmpDesignError, match="3 or more"):
        fit_force_scale(weights, np.where(weights.mass_g < 100, read, np.nan), 0 * read + 1e-4, 0.3)
    with pytest.raises(CmpDesignError, match="do not grow"):
        fit_force_scale(weights, 3 - read, 0 * read + 1e-4, 0.3)
