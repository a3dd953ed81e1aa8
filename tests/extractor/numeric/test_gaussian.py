"""The share of a blurred wedge in a pixel, against the bivariate normal distribution.

Inside: the share has a closed form, and an image shows sums of many shares under noise.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, owens_t

from extractor.numeric.gaussian import CORNER_TERMS, fill_corner_terms, normal_cdf, wedge_correlation

near = st.floats(-3.2, 3.2).filter(lambda z: abs(z) > 1e-3)


def wedge(h: float, k: float, r: float) -> float:
    """Probability that two normal deviates with the correlation r are below h and k, by Owen's T."""
    root = np.sqrt(1 - r * r)
    apart = 0.5 if h * k < 0 else 0.0
    joint = owens_t(h, (k / h - r) / root) + owens_t(k, (h / k - r) / root)
    return float(0.5 * (ndtr(h) + ndtr(k)) - joint - apart)


@settings(deadline=None)
@given(h=near, k=near, opening_deg=st.floats(20.0, 160.0))
def test_a_wedge_is_seen_as_it_should(h: float, k: float, opening_deg: float) -> None:
    r, corner = -np.cos(np.radians(opening_deg)), np.zeros(CORNER_TERMS, np.float32)
    fill_corner_terms(r, corner)
    one, other = np.float32(h), np.float32(k)
    share = normal_cdf(one) * normal_cdf(other)
    share += wedge_correlation(one * one + other * other, one * other, tuple(corner))
    atol = 1e-4 if 30.0 <= opening_deg <= 150.0 else 4e-4
    np.testing.assert_allclose(share, wedge(h, k, r), atol=atol)
