"""A layer's quadratic against numpy's.

Inside: the position of a fitted marker is a mean with its neighbours' estimate; an image shows the mean alone.
"""

from __future__ import annotations

import numpy as np

from extractor.complete.layer_arcs import predict_by_layer


def test_a_layers_quadratic_is_numpys() -> None:
    """Layer 8, sextant 2: markers on a quadratic with noise, three of them lost; the result agrees with polyfit.

    Layer 6 has residuals, too. The mean of both counts as four degrees of freedom.
    """
    rng = np.random.default_rng(1)
    ids, step = 3 * 8 * 7 + 1 + np.arange(16, 25), np.linspace(-1, 1, 9)
    xy = np.full((397, 2), np.nan)
    rows = np.vander(step, 3)
    xy[ids] = rows @ rng.uniform(-40, 40, (3, 2)) + rng.normal(0, 0.2, (9, 2))
    known = np.ones(9, np.bool_)
    known[[2, 5, 6]] = False
    xy[ids[~known]] = np.nan
    others, other_step = 3 * 6 * 5 + 1 + np.arange(0, 7), np.linspace(-1, 1, 7)
    xy[others] = rng.normal(0, 0.6, (7, 2))
    noise = rng.uniform(0.01, 0.1, 397)
    place, misfit, variance = predict_by_layer(xy, noise, 11)
    terms = np.polyfit(step[known], xy[ids[known]], 2)
    left = ((xy[ids[known]] - rows[known] @ terms) ** 2).sum()
    other_terms = np.polyfit(other_step, xy[others], 2)
    all_left = left + ((xy[others] - np.vander(other_step, 3) @ other_terms) ** 2).sum()
    own = (left + 4 * all_left / (2 * 3 + 2 * 4)) / (2 * 3 + 4)
    weights = rows @ np.linalg.pinv(rows[known])
    expected = own * (1 + (weights**2).sum(axis=1)) + weights**2 @ noise[ids[known]]
    np.testing.assert_allclose(place[ids[~known]], (rows @ terms)[~known])
    np.testing.assert_allclose(misfit[ids[~known]], (left / 6 * (1 + (weights**2).sum(axis=1)))[~known])
    np.testing.assert_allclose(variance[ids[~known]], expected[~known])
    assert np.isnan(place[np.setdiff1d(np.arange(397), ids[~known])]).all()
