"""Forces of large-strain finite elements, which share no code with the reader, within the stated accuracy."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.force.__main__ import LEAST_N, read_case
from benchmarks.force.truth import TRUTH, cases


@pytest.mark.slow  # Green's matrix of the pad
def test_force_and_regions_of_finite_element_frames() -> None:
    with np.load(TRUTH) as file:
        truth = dict(file)
    random, found = np.random.default_rng(7), []
    for case in cases():
        if case.thickness_mm == 4.0 and case.poisson == 0.5:
            mine = np.flatnonzero(truth["case"] == case.name)
            frames = [{key: values[k] for key, values in truth.items()} for k in mine]
            found += [one for one in read_case(case, frames, random, None) if one.press_n > LEAST_N]
    assert len(found) >= 11
    balls = [one for one in found if one.name in ("ball", "shear", "oblique", "twist")]
    errors = np.array([one.normal for one in balls])
    assert np.sqrt((errors**2).mean()) < 0.04 and np.abs(errors).max() < 0.09
    assert max(abs(one.normal) for one in found) < 0.12
    assert 0.5 < np.sqrt(np.mean([one.normal_z**2 for one in found])) < 1.5
    assert max(one.shear for one in found) < 0.06 and max(one.torque for one in found) < 0.10
    assert np.nanmax([abs(one.radius) for one in found]) < 0.25
    assert max(one.centre_mm for one in found) < 0.2
