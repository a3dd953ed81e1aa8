"""Stage 5 alone: ideal triangles are found exactly, from their moments and then from their edges.

Inside: refinement solves all cells together, so that an image does not show how well one triangle is found.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.cells.region_growing import Regions
from extractor.cells.triangle_fit import fit_edges, regions_as_cells
from extractor.image.pyramid import PyramidLevel
from extractor.pipeline import ImageReader
from tests.support.pictures import extractor, srgb_light, srgb_values

Points = NDArray[np.float64]
FINE = 8  # small pixels to a pixel and axis
BLACK, RED = srgb_light(np.array([20, 20, 20])), srgb_light(np.array([45, 50, 200]))


def half_planes(xy: Points, corners: Points) -> NDArray[np.bool_]:
    """Which of the points (..., 2) lie inside a triangle."""
    inside = np.ones(xy.shape[:-1], bool)
    middle = corners.mean(axis=0)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([b[1] - a[1], a[0] - b[0]])
        inside &= ((xy - a) @ normal) * ((middle - a) @ normal) >= 0
    return inside


def coverage(corners: Points, size: int) -> Points:
    """(size, size) share of every pixel inside the triangle; pixel (0, 0) is centred at the origin."""
    fine = (np.arange(size * FINE) + 0.5) / FINE - 0.5
    inside = half_planes(np.stack(np.meshgrid(fine, fine), axis=-1), corners)
    return inside.reshape(size, FINE, size, FINE).mean(axis=(1, 3))


def region_of(mask: NDArray[np.bool_]) -> Regions:
    """The region of a mask's pixels, with the moments that growing would have summed."""
    y, x = np.nonzero(mask)
    seed = np.array([round(x.mean()), round(y.mean())])
    u, v = (x - seed[0]).astype(float), (y - seed[1]).astype(float)
    terms = (u**0, u, v, u * u, u * v, v * v, u**3, u * u * v, u * v * v, v**3)
    return Regions(
        region_map=mask.astype(np.int32),
        seed=seed[None].astype(np.int32),
        moments=np.array([[term.sum() for term in terms]]),
    )


def triangle_of(view: PyramidLevel, mask: NDArray[np.bool_]) -> Points:
    """(3, 2) the triangle with the moments of a mask in a view, NaN if its shape is no triangle's."""
    nothing = np.full((1, 3, 2), np.nan)
    seed = Cells(np.zeros((1, 2)), np.zeros(1), nothing, np.zeros(1), np.zeros(1))
    return regions_as_cells(seed, region_of(mask), view).corner_px[0]


def measured(view: PyramidLevel, corners: Points) -> Points:
    """(3, 2) the triangle by its edges in the image at full scale."""
    return fit_edges(view, corners[None])[0]


def view_of(image: NDArray[np.uint8]) -> PyramidLevel:
    pyramid = ImageReader(extractor().layout).pyramid(image)
    assert pyramid is not None
    return pyramid.level(1)


def picture_of(cover: Points, blur_px: float) -> PyramidLevel:
    """The encoded picture of a triangle whose light is blurred."""
    smooth = cv2.GaussianBlur(cover, (0, 0), blur_px) if blur_px else cover
    return view_of(np.rint(srgb_values(BLACK + smooth[..., None] * (RED - BLACK))).astype(np.uint8))


def distance_px(found: Points, corners: Points) -> float:
    """The largest distance of a corner from its nearest true one, all three taken once."""
    away = np.linalg.norm(found[:, None] - corners[None], axis=2)
    assert sorted(away.argmin(axis=1)) == [0, 1, 2]
    return float(away.min(axis=1).max())


def angles_deg(corners: Points) -> Points:
    a, b = np.roll(corners, 1, axis=0) - corners, np.roll(corners, -1, axis=0) - corners
    cosine = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    return np.degrees(np.arccos(cosine))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(14, 34), st.floats(0.5, 1.3))
def test_any_triangle_is_found_to_a_fraction_of_a_pixel(seed: int, size_px: float, blur_px: float) -> None:
    """Random triangles with corners of 30 degrees or more, at random sub-pixel places, with room for their profiles."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(3) / 3 + rng.uniform(-0.45, 0.45, 3) + rng.uniform(0, 7)
    radius = 0.6 * size_px * rng.uniform(0.8, 1.2, 3)
    corners = (
        50 + rng.uniform(-0.5, 0.5, 2) + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    )
    assume(angles_deg(corners).min() > 30)
    cover = coverage(corners, 100)
    view = picture_of(cover, blur_px)
    found = measured(view, triangle_of(view, cover > 0.5))
    # a start for the refinement: edges to a fraction of a pixel, corners farther the sharper they are
    assert distance_px(found, corners) < 0.8 / np.sin(np.radians(angles_deg(corners).min()))
    a, b, c = found
    assert (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0] > 0  # clockwise with y down


@pytest.mark.parametrize("shift_px", np.linspace(0, 0.875, 8))
@pytest.mark.parametrize("turn_deg", [0, 17, 45, 90])
def test_an_equilateral_triangle_follows_sub_pixel_shifts(shift_px: float, turn_deg: float) -> None:
    angle = np.radians(turn_deg + 120 * np.arange(3))
    corners = 30 + shift_px + 13 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    cover = coverage(corners, 62)
    view = picture_of(cover, 0.8)
    assert distance_px(measured(view, triangle_of(view, cover > 0.5)), corners) < 0.35


@pytest.mark.parametrize("scale", [2, 3])
def test_regions_of_a_reduced_image_give_full_scale_corners(scale: int) -> None:
    angle = np.radians(20 + 120 * np.arange(3))
    corners = 60.3 + 40 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    cover = coverage(corners, 120)
    small = cover.reshape(120 // scale, scale, 120 // scale, scale).mean(axis=(1, 3))
    view = picture_of(cover, 1.0)
    found = measured(view, triangle_of(view._replace(scale=scale), small > 0.5))
    assert distance_px(found, corners) < 0.35


SHAPES = {
    "disc": lambda x, y: np.hypot(x, y) < 12,
    "square": lambda x, y: (abs(x) < 11) & (abs(y) < 11),
    "stripe": lambda x, y: (abs(x) < 2) & (abs(y) < 25),
    "hexagon": lambda x, y: (abs(y) < 11) & (abs(y) + 1.73 * abs(x) < 22),
    "dot": lambda x, y: (abs(x) < 1) & (abs(y) < 1),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_no_triangle_is_dropped(shape: str) -> None:
    y, x = np.mgrid[-32:32, -32:32]
    mask = SHAPES[shape](x, y)
    assert np.isnan(triangle_of(picture_of(mask.astype(np.float64), 0.7), mask)).all()


def test_a_triangle_without_contrast_is_dropped() -> None:
    """The region is a triangle, and the image has no edge there."""
    corners = np.array([[12.0, 40.0], [32.0, 10.0], [50.0, 42.0]])
    view = view_of(np.full((64, 64, 3), 60, np.uint8))
    found = triangle_of(view, coverage(corners, 64) > 0.5)
    assert distance_px(found, corners) < 1.0
    assert np.isnan(measured(view, found)).all()


def test_no_cells_no_triangles() -> None:
    assert fit_edges(view_of(np.zeros((20, 20, 3), np.uint8)), np.zeros((0, 3, 2))).shape == (0, 3, 2)
