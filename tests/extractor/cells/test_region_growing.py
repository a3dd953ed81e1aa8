"""Stages 3 and 4 alone: seeds, and growing against plain eq. 3.

Inside: triangles are fitted to edges for any end of the growing, so that markers do not show errors of eq. 3.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from extractor.cells.region_growing import LIMITS, grow
from extractor.cells.seeds import find_seeds
from extractor.image.ink_segmentation import Segmentation
from tests.support.layouts import small_layout
from tests.support.pictures import extractor, picture

Image = NDArray[np.uint8]


def segmentation_of(hsv: Image, label: Image) -> Segmentation:
    return Segmentation(
        hsv=hsv, label=label, hues_deg=np.array([0.0, 120.0, 240.0]), chroma=np.full(3, 150.0)
    )


def test_seeds_are_in_their_domains() -> None:
    """A ring, a crescent and an L have their centroid outside; their seed is the nearest pixel inside."""
    label = np.zeros((80, 200), np.uint8)
    cv2.circle(label, (40, 40), 28, 1, 9)
    cv2.circle(label, (110, 40), 30, 2, -1)
    cv2.circle(label, (120, 40), 26, 0, -1)
    label[10:70, 150:156] = 3
    label[64:70, 150:195] = 3
    label[20:50, 170:195] = 1
    label[5, 5] = 2  # clutter
    seeds = find_seeds(segmentation_of(np.zeros((*label.shape, 3), np.uint8), label))
    count, domain, stats, _ = cv2.connectedComponentsWithStats(
        (label > 0).astype(np.uint8) * 1, connectivity=4
    )
    assert len(seeds.ink) == 4 == count - 2
    at = seeds.xy[:, 1], seeds.xy[:, 0]
    np.testing.assert_array_equal(label[at], seeds.ink)
    np.testing.assert_array_equal(stats[domain[at], cv2.CC_STAT_AREA], seeds.area_px)
    for seed, number in zip(seeds.xy, domain[at], strict=True):
        y, x = np.nonzero(domain == number)
        away = np.hypot(x - x.mean(), y - y.mean())
        assert np.hypot(*(seed - (x.mean(), y.mean()))) <= away.min() + 0.75
        center = seeds.center[np.flatnonzero((seeds.xy == seed).all(axis=1))[0]]
        np.testing.assert_allclose(center, (x.mean(), y.mean()), atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 24), st.integers(1, 24), st.floats(0.1, 0.9))
def test_domains_are_4_connected_components(seed: int, height: int, width: int, full: float) -> None:
    """Random labels: as many seeds as OpenCV finds components, of the same inks and areas."""
    rng = np.random.default_rng(seed)
    label = np.where(rng.random((height, width)) < full, rng.integers(1, 4, (height, width)), 0).astype(
        np.uint8
    )
    seeds = find_seeds(segmentation_of(np.zeros((height, width, 3), np.uint8), label))
    expected = []
    for ink in (1, 2, 3):
        stats = cv2.connectedComponentsWithStats((label == ink).astype(np.uint8), connectivity=4)[2]
        expected += [(ink, int(area)) for area in stats[1:, cv2.CC_STAT_AREA] if area >= 4]
    assert sorted(zip(seeds.ink.tolist(), seeds.area_px.tolist(), strict=True)) == sorted(expected)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
@example(256)  # a tip of one pixel that touches by its corner
def test_in_a_crowd_what_is_convex_is_left(seed: int) -> None:
    """A triangle, which has the least area of all convex shapes for the spread of its pixels, beside a comb."""
    rng = np.random.default_rng(seed)
    label = np.zeros((60, 140), np.uint8)
    angles = rng.uniform(0, 2 * np.pi) + np.cumsum([0, *rng.uniform(1.6, 2.6, 2)])
    corners = 28 + rng.uniform(8, 25) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    cv2.fillConvexPoly(label, np.rint(corners).astype(np.int32), 1)
    label[5:8, 70:130] = label[8:50, 70:130:6] = 2
    label[55, 70:75] = 3  # too small
    segmentation = segmentation_of(np.zeros((*label.shape, 3), np.uint8), label)
    assert set(find_seeds(segmentation, 3).ink.tolist()) == {1, 2, 3}
    seeds = find_seeds(segmentation, 2)
    assert seeds.cluttered and seeds.ink.tolist() == [1]
    stats = cv2.connectedComponentsWithStats((label == 1).astype(np.uint8), connectivity=4)[2]
    assert seeds.area_px[0] == stats[1:, cv2.CC_STAT_AREA].max()  # the tip may touch by a corner only


def plain_growing(
    hsv: Image, label: Image, seed: tuple[int, int], ink: int, taken: NDArray[np.bool_], again: bool = False
) -> NDArray[np.bool_]:
    """Eq. 3 in waves of 4-neighbours on whole arrays; the hue as an angle, by its nearest turn to the mean.

    ``again`` judges pixels beside older waves again as the mean moves, as the article does.
    """
    region = np.zeros(label.shape, bool)
    region[seed[1], seed[0]] = True
    wave = region.copy()
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
    pixels = hsv.astype(np.float64)
    start = pixels[seed[1], seed[0], 0]
    unwrapped = start + (pixels[..., 0] - start + 90) % 180 - 90
    while True:
        mean = np.array([unwrapped[region].mean() % 180, *pixels[region][:, 1:].mean(axis=0)])
        ring = cv2.dilate((region if again else wave).astype(np.uint8), cross).astype(bool) & ~region & ~taken
        ring &= (label == ink) | (label == 0)
        there = pixels[ring]
        there[:, 0] = mean[0] + (there[:, 0] - mean[0] + 90) % 180 - 90
        product = there @ mean
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.sqrt(((there - mean) ** 2).sum(axis=1)) / np.sqrt(product)
        similar = (product > 0) & (distance < LIMITS.threshold)
        if not similar.any():
            return region
        wave = ring
        wave[ring] = similar
        region |= wave


def assert_grown_as_plainly(hsv: Image, label: Image) -> None:
    segmentation = segmentation_of(hsv, label)
    seeds = find_seeds(segmentation)
    regions = grow(segmentation, seeds)
    taken = np.zeros(label.shape, bool)
    assert len(seeds.ink)
    for number, (seed, ink) in enumerate(zip(seeds.xy.tolist(), seeds.ink.tolist(), strict=True)):
        if taken[seed[1], seed[0]]:
            continue
        expected = plain_growing(hsv, label, (seed[0], seed[1]), ink, taken)
        np.testing.assert_array_equal(regions.region_map == number + 1, expected)
        taken |= expected


def test_growing_is_eq_3_on_a_picture() -> None:
    seen = picture("round", 2, pitch_px=20, size=(120, 100))
    found = extractor("round", 2).extract(seen.image).stages["segment"]
    assert_grown_as_plainly(found.hsv, found.label)
    seeds = find_seeds(found)
    owner = grow(found, seeds).region_map
    nothing = np.zeros(owner.shape, bool)
    for number, (seed, ink) in enumerate(zip(seeds.xy.tolist(), seeds.ink.tolist(), strict=True)):
        final = plain_growing(found.hsv, found.label, (seed[0], seed[1]), ink, nothing, again=True)
        assert ((owner == number + 1) != final).sum() <= 0.1 * final.sum()


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0, 2, 60, 90, 178, 179]),
    st.sampled_from([0.0, 1.0, 4.0, 12.0]),
)
def test_growing_is_eq_3_on_anything(seed: int, hue: int, noise: float) -> None:
    """Random fields around any hue, the wrap included, with black holes where P . mean may be 0."""
    rng = np.random.default_rng(seed)
    base = np.array([hue, 190, 170]) + rng.normal(0, noise, (24, 30, 3))
    base[..., 0] %= 180
    hsv, label = np.zeros((70, 70, 3), np.uint8), np.zeros((70, 70), np.uint8)
    hsv[20:44, 20:50] = np.clip(np.rint(base), 0, (179, 255, 255))
    hsv[28:31, 28:31] = 0
    label[24:40, 25:45] = hsv[24:40, 25:45, 2] > 0
    assert_grown_as_plainly(hsv, label)


def test_black_neither_divides_nor_grows() -> None:
    """Hue, saturation and value 0 everywhere: P . mean = 0 rejects without a warning, and the seed stays alone."""
    hsv = np.zeros((20, 20, 3), np.uint8)
    label = np.zeros((20, 20), np.uint8)
    label[8:12, 8:12] = 1
    with np.errstate(all="raise"):
        regions = grow(segmentation_of(hsv, label), find_seeds(segmentation_of(hsv, label)))
    assert (regions.region_map > 0).sum() == 1 and regions.moments[0, 0] == 1


def test_hue_wraps_while_growing() -> None:
    """Left 178, where the seed is, right 1: three steps of hue apart, one region; the mean does not become cyan."""
    hsv, label = np.zeros((60, 120, 3), np.uint8), np.zeros((60, 120), np.uint8)
    hsv[20:40, 40:64], hsv[20:40, 64:80] = (178, 200, 200), (1, 200, 200)
    label[20:40, 40:80] = 1
    seeds = find_seeds(segmentation_of(hsv, label))
    assert seeds.xy[0, 0] < 64
    np.testing.assert_array_equal(grow(segmentation_of(hsv, label), seeds).region_map, label)
    hsv[20:40, 64:80, 0] = 178 - 90  # the opposite hue stays out
    assert not grow(segmentation_of(hsv, label), seeds).region_map[:, 64:].any()


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_no_region_leaks_into_another_cell(pattern: str) -> None:
    """Every region lies inside one cell of the layout, up to its blurred rim, and every cell has one region."""
    layout, seen = small_layout(pattern, 4), picture(pattern)
    found = extractor(pattern).extract(seen.image).stages["segment"]
    regions = grow(found, find_seeds(found))
    corners = seen.truth.marker_xy_px[layout.cell_corners]
    middle = corners.mean(axis=1, keepdims=True)
    seen_cells = set()
    for number in np.unique(regions.region_map[regions.region_map > 0]):
        y, x = np.nonzero(regions.region_map == number)
        if len(x) < 30:
            continue
        cell = int(np.hypot(*(middle[:, 0] - (x.mean(), y.mean())).T).argmin())
        size = np.linalg.norm(corners[cell] - middle[cell], axis=1).mean()
        wider = (middle[cell] + (corners[cell] - middle[cell]) * (1 + 3.0 / size)).astype(np.float32)
        outside = [
            cv2.pointPolygonTest(wider, (float(a), float(b)), False) < 0 for a, b in zip(x, y, strict=True)
        ]
        assert not any(outside)
        assert layout.cell_color[cell] == regions.ink[number - 1] - 1
        assert cell not in seen_cells
        seen_cells.add(cell)
    assert seen_cells == set(np.flatnonzero(layout.cell_color < 3).tolist())


def test_moments_are_the_regions() -> None:
    found = extractor().extract(picture().image).stages["segment"]
    regions = grow(found, find_seeds(found))
    for number in range(0, len(regions.ink), 5):
        y, x = np.nonzero(regions.region_map == number + 1)
        u, v = (x - regions.seed[number, 0]).astype(float), (y - regions.seed[number, 1]).astype(float)
        terms = (u**0, u, v, u * u, u * v, v * v, u**3, u * u * v, u * v * v, v**3)
        np.testing.assert_allclose(regions.moments[number], [term.sum() for term in terms], atol=1e-6)
