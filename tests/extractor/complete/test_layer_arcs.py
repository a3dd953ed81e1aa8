"""A layer's quadratic against numpy's.

Inside: the position of a fitted marker is a mean with its neighbours' estimate; an image shows the mean alone.
"""

from __future__ import annotations

import numpy as np

from extractor.complete.layer_arcs import predict_by_layer


def test_a_layers_quadratic_is_numpys() -> None:
    """Layer 8, sextant 2: markers on a quadratic with noise, three of them lost; the result agrees with polyfit."""
    rng = np.random.default_rng(1)
    ids, step = 3 * 8 * 7 + 1 + np.arange(16, 25), np.linspace(-1, 1, 9)
    xy = np.full((397, 2), np.nan)
    rows = np.vander(step, 3)
    xy[ids] = rows @ rng.uniform(-40, 40, (3, 2)) + rng.normal(0, 0.2, (9, 2))
    known = np.ones(9, np.bool_)
    known[[2, 5, 6]] = False
    xy[ids[~known]] = np.nan
    place, variance = predict_by_layer(xy, 11)
    terms = np.polyfit(step[known], xy[ids[known]], 2)
    left = ((xy[ids[known]] - rows[known] @ terms) ** 2).sum() / (2 * 3)
    leverage = np.diag(rows @ np.linalg.inv(rows[known].T @ rows[known]) @ rows.T)
    np.testing.assert_allclose(place[ids[~known]], (rows @ terms)[~known])
    np.testing.assert_allclose(variance[ids[~known]], (left * (1 + leverage))[~known])
    assert np.isnan(place[np.setdiff1d(np.arange(397), ids[~known])]).all()
