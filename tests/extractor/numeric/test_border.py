"""The interface between Python and the native loops: wrong arrays are refused by name, and no array is converted.

Inside: the package's calls pass correct arrays, and values written to a converted copy would be lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from extractor.localmap.neighbour_prediction import predict_markers
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.median import median_of

VALUES = np.random.default_rng(0).uniform(0, 9, 12)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (VALUES.astype(np.float32), "values must be float64 of 1 dimensions, and is 'f' of 1"),
        (VALUES.reshape(6, 2), "values must be float64 of 1 dimensions, and is 'd' of 2"),
        (VALUES[::-1], "values has gaps within its rows; give a contiguous array"),
        (VALUES.tolist(), "values is no array"),
        (VALUES.astype(">f8"), "values must be float64"),
    ],
)
def test_a_wrong_array_is_named(values: Any, text: str) -> None:
    with pytest.raises(TypeError, match=text):
        median_of(values, 5)


def test_a_row_may_be_far_from_the_next() -> None:
    """Rows of a larger array have no gaps within them."""
    points, count = VALUES.reshape(6, 2), 6
    wide = np.zeros((count, 5))
    wide[:, :2] = points
    table = np.array([[j for j in range(count) if j != i] for i in range(count)], np.int32)
    one, other = (
        predict_markers(xy, np.ones(count), np.ones(count, np.bool_), points * 0.5, table)
        for xy in (wide[:, :2], points)
    )
    assert np.isfinite(other.xy_px).any()
    for narrow, whole in zip(one, other, strict=True):
        np.testing.assert_array_equal(narrow, whole)


def test_what_is_written_must_be_writable() -> None:
    image, out = np.full(20 * 20 * 3, 7, np.uint8), np.zeros(3)
    assert fill_patch_mean(image, 20, 20, 9.0, 9.0, 2.0, out)
    np.testing.assert_allclose(out, 7)
    out.setflags(write=False)
    with pytest.raises(TypeError, match="out is no array that can be written"):
        fill_patch_mean(image, 20, 20, 9.0, 9.0, 2.0, out)
