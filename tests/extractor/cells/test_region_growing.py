"""Stage 4 alone: growing against plain eq. 3.

Inside: triangles are fitted to edges for any end of the growing, so that markers do not show errors of eq. 3.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from extractor.cells.cells import EFFORTS, Cells, find_cells
from extractor.cells.region_growing import MAX_GROWN_AREA, grow
from extractor.image.pyramid import PyramidLevel
from extractor.pipeline import ImageReader
from tests.support.layouts import small_layout
from tests.support.pictures import extractor, picture

Image = NDArray[np.uint8]
PITCH_PX = 26.0
THRESHOLD = 0.15  # as in the article, below eq. 3


def view_of(image: Image) -> PyramidLevel:
    pyramid = ImageReader(extractor().layout).pyramid(image)
    assert pyramid is not None
    return pyramid.level(1)


def cells_at(xy: list[tuple[float, float]], area_px: float) -> Cells:
    """Seeds at places (x, y) with a stated area; growing reads nothing else."""
    count = len(xy)
    centre = np.array(xy, np.float64).reshape(count, 2)
    return Cells(centre, np.full(count, area_px), np.zeros((count, 3, 2)), np.zeros(count), np.zeros(count))


def plain_growing(hsv: Image, seed: tuple[int, int], taken: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Eq. 3 in waves of 4-neighbours on whole arrays; the hue as an angle, by its nearest turn to the mean."""
    region = np.zeros(taken.shape, bool)
    region[seed[1], seed[0]] = True
    wave = region.copy()
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
    pixels = hsv.astype(np.float64)
    start = pixels[seed[1], seed[0], 0]
    unwrapped = start + (pixels[..., 0] - start + 90) % 180 - 90
    while True:
        mean = np.array([unwrapped[region].mean() % 180, *pixels[region][:, 1:].mean(axis=0)])
        ring = cv2.dilate(wave.astype(np.uint8), cross).astype(bool) & ~region & ~taken
        there = pixels[ring]
        there[:, 0] = mean[0] + (there[:, 0] - mean[0] + 90) % 180 - 90
        product = there @ mean
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.sqrt(((there - mean) ** 2).sum(axis=1)) / np.sqrt(product)
        similar = (product > 0) & (distance < THRESHOLD)
        if not similar.any():
            return region
        wave = ring
        wave[ring] = similar
        region |= wave


def assert_grown_as_plainly(image: Image, cells: Cells) -> int:
    """Regions within the limit of area are those of plain eq. 3; the others have no moments. Returns the former's
    number."""
    regions, hsv = grow(view_of(image), cells), cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    taken = np.zeros(image.shape[:2], bool)
    limit_px = (MAX_GROWN_AREA * cells.area_px).astype(int)
    grown = 0
    for number, (x, y) in enumerate(regions.seed.tolist()):
        own = regions.region_map == number + 1
        if not taken[y, x]:
            expected = plain_growing(hsv, (x, y), taken)  # type: ignore[arg-type]
            if expected.sum() <= limit_px[number]:
                np.testing.assert_array_equal(own, expected)
                assert regions.moments[number, 0] == expected.sum()
                grown += 1
            else:
                assert regions.moments[number, 0] == 0
        else:
            assert not own.any()
        taken |= own
    return grown


def found_cells(image: Image) -> Cells:
    return find_cells(view_of(image), PITCH_PX, EFFORTS[1])


def test_growing_is_eq_3_on_a_picture() -> None:
    image = picture("round", 2, pitch_px=20, size=(120, 100)).image
    assert assert_grown_as_plainly(image, found_cells(image)) >= 14


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0, 2, 60, 90, 178, 179]),
    st.sampled_from([0.0, 1.0, 4.0, 12.0]),
    st.sampled_from([10.0, 1000.0]),
)
def test_growing_is_eq_3_on_anything(seed: int, hue: int, noise: float, area_px: float) -> None:
    """Random fields around any hue, the wrap included, with black holes where P . mean may be 0."""
    rng = np.random.default_rng(seed)
    base = np.array([hue, 190, 170]) + rng.normal(0, noise, (24, 30, 3))
    base[..., 0] %= 180
    hsv = np.zeros((60, 60, 3), np.uint8)
    hsv[20:44, 20:50] = np.clip(np.rint(base), 0, (179, 255, 255))
    hsv[28:31, 28:31] = 0
    image = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR).astype(np.uint8)
    assert_grown_as_plainly(image, cells_at([(25.0, 25.0), (29.0, 29.0), (44.0, 40.0)], area_px))


def test_black_neither_divides_nor_grows() -> None:
    """Hue, saturation and value 0 everywhere: P . mean = 0 rejects without a warning, and the seed stays alone."""
    with np.errstate(all="raise"):
        regions = grow(view_of(np.zeros((20, 20, 3), np.uint8)), cells_at([(9.0, 9.0)], 50.0))
    assert (regions.region_map > 0).sum() == 1 and regions.moments[0, 0] == 1


def test_hue_wraps_while_growing() -> None:
    """Left 178, where the seed is, right 1: three steps of hue apart, one region; the mean does not become cyan."""
    hsv = np.zeros((60, 120, 3), np.uint8)
    hsv[20:40, 40:64], hsv[20:40, 64:80] = (178, 200, 200), (1, 200, 200)
    cells = cells_at([(50.0, 30.0)], 800.0)
    image = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR).astype(np.uint8)
    np.testing.assert_array_equal(grow(view_of(image), cells).region_map > 0, hsv[..., 2] > 0)
    hsv[20:40, 64:80, 0] = 178 - 90  # the opposite hue stays out
    image = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR).astype(np.uint8)
    assert not grow(view_of(image), cells).region_map[:, 64:].any()


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_no_region_leaks_into_another_cell(pattern: str) -> None:
    """Every region lies inside one cell of the layout, up to its blurred rim, and all cells but one have a region."""
    layout, seen = small_layout(pattern, 4), picture(pattern)
    regions = grow(view_of(seen.image), found_cells(seen.image))
    corners = seen.truth.marker_xy_px[layout.cell_corners]
    middle = corners.mean(axis=1, keepdims=True)
    seen_cells = set()
    for number in np.flatnonzero(regions.moments[:, 0] >= 30):
        y, x = np.nonzero(regions.region_map == number + 1)
        cell = int(np.hypot(*(middle[:, 0] - (x.mean(), y.mean())).T).argmin())
        size = np.linalg.norm(corners[cell] - middle[cell], axis=1).mean()
        wider = (middle[cell] + (corners[cell] - middle[cell]) * (1 + 3.0 / size)).astype(np.float32)
        outside = [
            cv2.pointPolygonTest(wider, (float(a), float(b)), False) < 0 for a, b in zip(x, y, strict=True)
        ]
        assert not any(outside)
        assert cell not in seen_cells
        seen_cells.add(cell)
    assert len(set(np.flatnonzero(layout.cell_color < 3).tolist()) - seen_cells) <= 1


def test_moments_are_the_regions() -> None:
    image = picture().image
    regions = grow(view_of(image), found_cells(image))
    for number in range(0, len(regions.seed), 5):
        if regions.moments[number, 0] == 0:
            continue
        y, x = np.nonzero(regions.region_map == number + 1)
        u, v = (x - regions.seed[number, 0]).astype(float), (y - regions.seed[number, 1]).astype(float)
        terms = (u**0, u, v, u * u, u * v, v * v, u**3, u * u * v, u * v * v, v**3)
        np.testing.assert_allclose(regions.moments[number], [term.sum() for term in terms], atol=1e-6)
