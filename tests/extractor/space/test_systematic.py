"""Errors of window and gel that are stated in the rig: the systematic deviation of displacements is true."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from extractor import Medium, Reconstructor, Rig, RigError, parse_rig
from tests.support.view_scenes import flat, noisy, pair, pressed, reference, unplaced

LAYOUT = reference(layers=3)
TRUE = pressed(LAYOUT.xy_mm)
DEVIATION = {"gel_mm": 0.05, "gel_index": 0.005, "window_mm": 0.05}


def stated(medium: Medium) -> Rig:
    views = tuple(replace(view, medium=medium) for view in unplaced(pair()).views)
    return Rig(views, DEVIATION)


@pytest.mark.slow
def test_the_systematic_deviation_is_true() -> None:
    """Sensors whose media differ from the stated one by draws of the stated deviations."""
    rng, true = np.random.default_rng(46), Medium(4.0, 1.41, 2.0, 1.49)
    views = tuple(replace(view, medium=true) for view in pair())
    rest, now = ([noisy(LAYOUT, v, xyz, rng, 0.004) for v in views] for xyz in (flat(LAYOUT), TRUE))
    deepest, squares = TRUE[:, 2].argmin(), []
    for _ in range(12):
        drawn = {name: getattr(true, name) + rng.normal(0, value) for name, value in DEVIATION.items()}
        shape = Reconstructor(LAYOUT, stated(replace(true, **drawn)), rest, model_px=0.0).reconstruct(now)
        error_mm = shape.displacement_mm[deepest, 2] - TRUE[deepest, 2]
        systematic_mm, cov_mm2 = (
            shape.displacement_systematic_mm[deepest],
            shape.displacement_cov_mm2[deepest],
        )
        assert systematic_mm[2] > np.sqrt(cov_mm2[2, 2])  # noise is not what is tested
        squares.append(error_mm**2 / (systematic_mm[2] ** 2 + cov_mm2[2, 2]))
    assert 0.7 < np.sqrt(np.mean(squares)) < 1.3


def test_the_systematic_deviation_is_that_of_another_sensor() -> None:
    """Linear in the difference, it is the difference of two readings of the same pictures."""
    rng, medium, views = np.random.default_rng(2), Medium(4.0, 1.41, 2.0, 1.49), pair()
    seen = tuple(replace(view, medium=medium) for view in views)
    rest, now = ([noisy(LAYOUT, v, xyz, rng, 0.004) for v in seen] for xyz in (flat(LAYOUT), TRUE))
    rig = replace(stated(medium), medium_deviation={"gel_index": 0.005})
    shape = Reconstructor(LAYOUT, rig, rest).reconstruct(now)
    other = Reconstructor(LAYOUT, stated(replace(medium, gel_index=1.415)), rest).reconstruct(now)
    difference_mm = np.abs(other.displacement_mm - shape.displacement_mm)[:, 2]
    pressed_far = np.flatnonzero(TRUE[:, 2] < -0.3)
    np.testing.assert_allclose(
        shape.displacement_systematic_mm[pressed_far, 2], difference_mm[pressed_far], rtol=0.1
    )


def test_an_exact_medium_has_no_systematic_deviation() -> None:
    rng = np.random.default_rng(1)
    views = pair()
    rest, now = ([noisy(LAYOUT, v, xyz, rng) for v in views] for xyz in (flat(LAYOUT), TRUE))
    shape = Reconstructor(LAYOUT, unplaced(views), rest).reconstruct(now)
    assert not shape.displacement_systematic_mm[np.isfinite(shape.xyz_mm)].any()


RIG = """
[[view]]
focal_px = [900, 900]
centre_px = [319.5, 239.5]
lens = "fisheye"
distortion = [0.01, 0.0, 0.0, 0.0]
[medium]
gel_mm = 4.0
gel_index = 1.41
[medium_deviation]
gel_mm = 0.05
"""


def test_the_file_states_lens_and_deviations() -> None:
    rig = pickle.loads(pickle.dumps(parse_rig(RIG)))
    assert rig.medium_deviation == {"gel_mm": 0.05} and rig.views[0].lens == "fisheye"
    assert rig.without_poses().medium_deviation == {"gel_mm": 0.05}
    for old, new, said in (
        ("gel_mm = 0.05", "gel_mm = -0.05", "medium_deviation.gel_mm is -0.05; expected a number from 0"),
        (
            "gel_mm = 0.05",
            "window_mm = 0.05",
            "medium_deviation.window_mm is given, but [medium] has no window_mm",
        ),
        ("gel_mm = 0.05", "gel = 0.05", "medium_deviation.'gel' is unknown"),
        ('"fisheye"', '"wide"', "view[0].lens is 'wide'"),
        ("[0.01, 0.0, 0.0, 0.0]", "[0.01]", "view[0].distortion is a list of 1; expected 4 numbers"),
    ):
        with pytest.raises(RigError) as raised:
            parse_rig(RIG.replace(old, new))
        assert said in str(raised.value)
