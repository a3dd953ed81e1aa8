"""Large blots beside a pattern, or on it: its cells are small beside them, and whole all the same."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from extractor import Reason, Status
from tests.support.errors import errors_px
from tests.support.layouts import small_layout
from tests.support.pictures import extractor, scene_of

INKS = ((45, 50, 200), (60, 150, 40), (190, 60, 45))  # BGR


@pytest.mark.parametrize("radius_px", [15, 25, 45, 70])
@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_cells_beside_large_blots_are_read(pattern: str, radius_px: int) -> None:
    """Blots of the pattern's inks around the pattern. Blots as large as some cells may hide the outline; the white
    paper between the blots could then be white cells, and no marker is numbered."""
    seen = scene_of(small_layout(pattern, 5), pitch_px=18.0, size=(480, 400))
    image, true = seen.image.copy(), seen.truth.marker_xy_px
    middle = true.mean(axis=0)
    for number, angle in enumerate(np.linspace(0, 2 * np.pi, 7)[:6]):
        toward = np.array([np.cos(angle), np.sin(angle)])
        reach = ((true - middle) @ toward).max() + radius_px + 12
        x, y = np.rint(middle + reach * toward).astype(int).tolist()
        cv2.circle(image, (x, y), radius_px, INKS[number % 3], -1, cv2.LINE_AA)
    markers = extractor(pattern, 5).extract(image)
    if radius_px < 40 and markers.reason is Reason.REFERENCE_LOST:
        return
    assert (markers.status == Status.MEASURED).all() and errors_px(markers, seen).max() < 0.1


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical"])
def test_of_cells_under_a_blot_only_these_are_lost(pattern: str) -> None:
    seen = scene_of(small_layout(pattern, 5), pitch_px=18.0, size=(480, 400))
    image, true = seen.image.copy(), seen.truth.marker_xy_px
    for marker in (20, 60):
        blotted = image.copy()
        x, y = np.rint(true[marker]).astype(int).tolist()
        cv2.circle(blotted, (x, y), 30, INKS[0], -1, cv2.LINE_AA)
        markers = extractor(pattern, 5).extract(blotted)
        away = np.linalg.norm(true - true[marker], axis=1)
        assert (markers.status[away > 60] == Status.MEASURED).all()
        error = errors_px(markers, seen)
        assert np.nanmedian(error) < 0.17 and np.nanmax(error) < 0.16 * 18.0
