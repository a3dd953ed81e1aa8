"""Threads: their number changes nothing, and extractors in several threads do not disturb each other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import cv2
import pytest

from extractor import Extractor
from tests.support.pictures import extractor, picture

PICTURES = [(pattern, turn) for pattern in ("honeycomb", "round") for turn in (0.0, 17.0, 90.0)]


def marks(pattern: str, turn: float, by: Extractor | None = None) -> bytes:
    reader = by or Extractor(extractor(pattern).layout)
    markers = reader.extract(picture(pattern, rotation_deg=turn).image)
    return markers.xy_px.tobytes() + markers.cov_px2.tobytes()


@pytest.mark.parametrize("threads", [2, 5])
def test_the_number_of_threads_changes_nothing(threads: int) -> None:
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        expected = marks("honeycomb", 17.0)
        cv2.setNumThreads(threads)
        assert marks("honeycomb", 17.0) == expected
    finally:
        cv2.setNumThreads(before)


def test_an_extractor_in_each_thread() -> None:
    expected = [marks(*each) for each in PICTURES]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda each: marks(*each), PICTURES * 3))
    assert found == expected * 3
