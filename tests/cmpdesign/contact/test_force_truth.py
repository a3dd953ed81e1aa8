"""Forces of large-strain finite elements, which share no code with the reader, within the stated accuracy."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.force.__main__ import MIN_N, read_case
from benchmarks.force.truth import TRUTH, cases

NARROW = ("ring", "two balls")  # narrower than the distance of two loads


@pytest.mark.slow  # Green's matrix of the pad
def test_forces_torques_and_regions_of_finite_element_frames_and_their_deviations() -> None:
    with np.load(TRUTH) as file:
        truth = dict(file)
    random, found, tested = np.random.default_rng(7), [], []
    for case in cases():
        if case.thickness_mm == 4.0 and case.poisson == 0.5:
            mine = np.flatnonzero(truth["case"] == case.name)
            frames = [{key: values[k] for key, values in truth.items()} for k in mine]
            read = [one for one in read_case(case, frames, random) if one.press_n > MIN_N]
            found += read
            tested += [] if case.fitted else read
    assert len(found) >= 30
    errors = np.array([one.normal for one in found if one.name not in NARROW])
    assert np.sqrt((errors**2).mean()) < 0.04 and np.abs(errors).max() < 0.09
    assert max(abs(one.normal) for one in found) < 0.12
    of_shear = np.array([one.of_shear for one in found if np.isfinite(one.of_shear)])
    assert len(of_shear) >= 12 and np.sqrt((of_shear**2).mean()) < 0.03 and of_shear.max() < 0.06
    torque = np.array([one.torque for one in found])
    assert (
        np.sqrt((torque**2).mean()) < 0.06
        and max(one.torque for one in found if one.name not in NARROW) < 0.1
    )
    assert np.nanmax([abs(one.radius) for one in found if one.name not in NARROW]) < 0.25
    assert max(one.centre_mm for one in found) < 0.2
    assert all(one.regions_off == 0 for one in found)
    for name in ("normal_z", "shear_z", "torque_z"):  # of the contacts by which nothing was chosen
        z = np.concatenate([np.atleast_1d(getattr(one, name)) for one in tested])
        assert 0.6 < np.sqrt((z**2).mean()) < 1.5
