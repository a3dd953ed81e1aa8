"""Vague markers: what others say of them is weighed against what they show themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Blob, Damage, Press, composed, render
from cmpdesign.scene.standard import BLACK_RGB, standard_layout, standard_scene
from extractor import Extractor, Status, parse_layout
from extractor.complete.uncertain_markers import UNCERTAIN_DEVIATION, find_uncertain_markers, update_by_fusion

Array = NDArray[Any]


@settings(deadline=None)  # the first call may compile
@given(
    wide=st.floats(0.01, 5.0),
    flat=st.floats(0.05, 1.0),
    angle=st.floats(0.0, 3.2),
    variance=st.floats(1e-4, 10.0),
    x=st.floats(-3.0, 3.0),
    y=st.floats(-3.0, 3.0),
)
def test_blending_adds_information(
    wide: float, flat: float, angle: float, variance: float, x: float, y: float
) -> None:
    """Inverse covariances add up, and places count by them."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    before = turn @ np.diag([wide**2, (flat * wide) ** 2]) @ turn.T
    start, place = np.array([100.0, 50.0]), np.array([100.0 + x, 50.0 + y])
    xy, cov = start.copy(), before.copy()
    update_by_fusion(xy, cov, place, variance)
    own = np.linalg.inv(before)
    expected = np.linalg.inv(own + np.eye(2) / variance)
    np.testing.assert_allclose(cov, expected, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(xy, expected @ (own @ start + place / variance), rtol=1e-8)


def test_others_that_know_nothing_and_others_that_know_all() -> None:
    for variance, moved in ((1e9, 0.0), (1e-9, 1.0)):
        xy, cov = np.zeros(2), np.diag([0.3, 0.1])
        update_by_fusion(xy, cov, np.array([1.0, -1.0]), variance)
        np.testing.assert_allclose(xy, [moved, -moved], atol=1e-6)
        np.testing.assert_allclose(cov, (1.0 - moved) * np.diag([0.3, 0.1]), atol=1e-6)


def test_vague_is_what_its_covariance_says_in_units_of_its_edges() -> None:
    cov = np.stack(
        [np.eye(2) * 0.5 * (UNCERTAIN_DEVIATION * 20.0 * share) ** 2 for share in (0.9, 1.1, np.nan)]
    )
    vague, some = find_uncertain_markers(cov, np.full(3, 20.0))
    assert vague.tolist() == [False, True, False] and some
    assert not find_uncertain_markers(cov, np.full(3, 40.0))[1]


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_under_dirt_others_help(pattern: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drops on a pressed pattern: the markers that they leave vague are nearer to the truth than they say themselves,
    and as near as their covariance says; no other marker moves."""
    places = ((-2.0, 1.5), (0.3, -2.4), (2.6, 0.8), (-0.9, 3.1), (-3.2, -1.4))
    drops = tuple(Blob(at, 0.45, BLACK_RGB) for at in places)
    layout = standard_layout(pattern, 8)
    scene = replace(standard_scene(layout), damage=Damage(blobs=drops), surface=composed(Press(4.0, 0.5)))
    seen = render(scene, size=(420, 400))
    extractor = Extractor(parse_layout(layout_to_json(layout)))
    blended = extractor.extract(seen.image)
    monkeypatch.setattr(
        "extractor.complete.repair.find_uncertain_markers",
        lambda cov, edge: (np.zeros(len(edge), np.bool_), False),
    )
    alone = extractor.extract(seen.image)
    both = (blended.status == Status.MEASURED) & (alone.status == Status.MEASURED)
    moved = both & (blended.xy_px != alone.xy_px).any(axis=1)
    assert moved.sum() >= 3

    def error(xy: Array) -> Array:
        return np.asarray(np.linalg.norm(xy - seen.truth.marker_xy_px, axis=1)[moved])

    def sigma(cov: Array) -> Array:
        return np.asarray(np.sqrt(np.trace(cov, axis1=1, axis2=2))[moved])

    assert np.sqrt(np.mean(error(blended.xy_px) ** 2)) < 0.4 * np.sqrt(np.mean(error(alone.xy_px) ** 2))
    assert (sigma(blended.cov_px2) < sigma(alone.cov_px2)).all()
    assert np.mean((error(blended.xy_px) / sigma(blended.cov_px2)) ** 2) < 2.0
