"""How much of each pixel is a cell: wedges against their distribution, whole cells against finely sampled ones."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, owens_t

from extractor.numeric.gaussian import CORNER_TERMS, fill_corner_terms, normal_cdf, wedge_correlation
from extractor.refine.synthesis.pattern_drawing import (
    allocate_coverage_runs,
    draw_cells,
    update_erasing_cells,
)

FINE, SIGMA, SHAPE = 15, 2.0, (100, 110)  # an odd number: pixels' middles are sampled
near = st.floats(-3.2, 3.2).filter(lambda z: abs(z) > 1e-3)


def wedge(h: float, k: float, r: float) -> float:
    """How often two normal deviates with the correlation r lie below h and k, by Owen's T."""
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


@pytest.mark.parametrize("turned_deg", [0.0, 20.0, 90.0, 180.0])
@pytest.mark.parametrize(
    "size", [3.0, 8.0, 30.0]
)  # with three sides near in most pixels, in some, and in none
def test_a_cell_is_drawn_as_it_is_blurred(size: float, turned_deg: float) -> None:
    """Of any size, with sides along the rows or the columns too; and inside the box only."""
    angle = np.radians(turned_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corners = size * np.array([[0.0, -1.0], [1.0, 0.75], [-0.9, 0.75]]) @ turn.T + (52.32, 47.83)
    edges, cells = np.array([[0, 1], [1, 2], [2, 0]], np.int32), np.array([[0, 1, 2]], np.int32)
    chords = corners[edges[:, 1]] - corners[edges[:, 0]]
    lines = np.zeros((3, 8))
    lines[:, 4] = np.linalg.norm(chords, axis=1)
    lines[:, :2], lines[:, 2:4], lines[:, 7] = corners[edges[:, 0]], chords / lines[:, 4:5], 1.0
    picture, strokes = np.zeros((*SHAPE, 3), np.float32), allocate_coverage_runs(1)
    box, which = np.array([25, 22, 81, 70]), np.ones(1, np.bool_)
    ink = np.full((1, 3), 100.0), np.zeros((1, 3, 2)), SIGMA, box, picture, strokes
    draw_cells(which, 1.0, corners, cells, cells, edges, lines, *ink)

    y, x = (np.mgrid[0 : SHAPE[0] * FINE, 0 : SHAPE[1] * FINE].astype(np.float32) + 0.5) / FINE - 0.5
    mask = np.ones(x.shape, np.bool_)
    for (x0, y0), (dx, dy) in zip(corners, chords, strict=True):
        mask &= (y - y0) * dx - (x - x0) * dy > 0
    fine = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), SIGMA * FINE)
    true = 100.0 * fine[FINE // 2 :: FINE, FINE // 2 :: FINE]
    inside = np.s_[box[1] : box[3], box[0] : box[2]]
    assert true.max() > 20.0 and np.abs(picture[inside] - true[inside][..., None]).max() < 0.8

    outside = picture.copy()
    outside[inside] = 0.0
    assert not outside.any()
    update_erasing_cells(which, corners, cells, cells, edges, lines, *ink)
    np.testing.assert_allclose(picture, 0.0, atol=1e-4)
