"""Inside: the tractions of a support, against numpy's equations; a reader shows them only summed up."""

from __future__ import annotations

import numpy as np
import pytest

from extractor.contact.active_set import settled


@pytest.mark.parametrize("loads", [0, 1, 3, 14, 45])
@pytest.mark.parametrize("axes", [2, 3])
def test_loads_that_press_are_in_equilibrium(loads: int, axes: int) -> None:
    random, information = np.random.default_rng(loads), 4.0
    by_load = random.normal(size=(loads, 3, 40 * axes)).astype(np.float32)
    whitening = random.normal(size=(40, axes, axes))
    white = random.normal(size=40 * axes)
    found = settled(by_load, whitening, white, information)
    kept = [int(one) for one in found.kept]
    by_kept = by_load[kept].reshape(3 * len(kept), 40, axes)
    design = np.einsum("mij,kmj->kmi", whitening, by_kept).reshape(3 * len(kept), 40 * axes)
    inverse = np.linalg.inv(design @ design.T + information * np.eye(len(design)))
    traction = inverse @ design @ white
    np.testing.assert_allclose(found.inverse, inverse, atol=1e-12)
    np.testing.assert_allclose(found.traction.ravel(), traction, atol=1e-12)
    np.testing.assert_allclose(found.residual, white - traction @ design, atol=1e-12)
    assert (found.traction[:, 2] < 0).all() and (len(kept) < loads or loads < 2)
