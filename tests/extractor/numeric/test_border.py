"""The interface between Python and the native loops: wrong arrays are refused by name, and no array is converted.

Inside: the package's calls pass correct arrays, and values written to a converted copy would be lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.nearest_points import nearest_points

POINTS = np.random.default_rng(0).uniform(0, 9, (12, 2))


@pytest.mark.parametrize(
    ("points", "text"),
    [
        (POINTS.astype(np.float32), "xy must be float64 of 2 dimensions, and is 'f' of 2"),
        (POINTS.ravel(), "xy must be float64 of 2 dimensions, and is 'd' of 1"),
        (POINTS[:, ::-1], "xy has gaps within its rows; give a contiguous array"),
        (POINTS.tolist(), "xy is no array"),
        (POINTS.astype(">f8"), "xy must be float64"),
    ],
)
def test_a_wrong_array_is_named(points: Any, text: str) -> None:
    with pytest.raises(TypeError, match=text):
        nearest_points(points, POINTS)


def test_a_row_may_be_far_from_the_next() -> None:
    """Rows of a larger array have no gaps within them."""
    wide = np.zeros((12, 5))
    wide[:, :2] = POINTS
    narrow, whole = (nearest_points(xy, POINTS, 4) for xy in (wide[:, :2], POINTS))
    np.testing.assert_array_equal(narrow, whole)


def test_what_is_written_must_be_writable() -> None:
    image, out = np.full(20 * 20 * 3, 7, np.uint8), np.zeros(3)
    assert fill_patch_mean(image, 20, 20, 9.0, 9.0, 2.0, out)
    np.testing.assert_allclose(out, 7)
    out.setflags(write=False)
    with pytest.raises(TypeError, match="out cannot be written"):
        fill_patch_mean(image, 20, 20, 9.0, 9.0, 2.0, out)
