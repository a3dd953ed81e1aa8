"""Small patterns, and small cells in large ones: read as well as at full scale, whatever else is in the image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.damage import parse_case
from benchmarks.suites.scoring.reading import cached_extractor, find_wrong_markers, read_case
from benchmarks.suites.scoring.score import score_markers
from benchmarks.suites.stress.conditions import BY_NAME, matching_cases
from benchmarks.suites.stress.frames import PATTERNS, CaseImage, plain_frame
from benchmarks.suites.stress.kinds import make_frame
from extractor import Status

AMID = ["pattern behind=14/elliptical/200", "pattern behind=30/round/100", "busy=400/honeycomb/0"]


def shot_of(name: str) -> CaseImage:
    case = matching_cases(name)[0]
    return make_frame(case, BY_NAME[case.kind]).shoot()


@pytest.mark.parametrize("name", [*AMID, "tilt=60/honeycomb/0"])
def test_a_small_pattern_amid_much_else_is_read_as_if_alone(name: str) -> None:
    """Cut out, with nothing around it, it is a small image that is read at full scale: all markers lie alike."""
    shot, by = shot_of(name), cached_extractor(name.split("/")[1], 11)
    markers = by.extract(shot.image)
    assert (markers.status == Status.MEASURED).all() and not find_wrong_markers(shot, markers)[0].any()

    true = shot.truths[0].marker_xy_px
    within = cv2.fillConvexPoly(
        np.zeros(shot.image.shape[:2], np.uint8), cv2.convexHull(np.rint(true).astype(np.int32)), 1
    )
    alone = np.where(cv2.dilate(within, np.ones((13, 13)))[..., None] > 0, shot.image, 20).astype(np.uint8)
    (left, top), (right, bottom) = (np.floor(true.min(axis=0)) - 12, np.ceil(true.max(axis=0)) + 12)
    low = np.maximum(np.array([left, top], int), 0)
    cut = by.extract(alone[low[1] : int(bottom), low[0] : int(right)])
    assert (cut.status == Status.MEASURED).all()
    apart = np.linalg.norm(markers.xy_px - low - cut.xy_px, axis=1)
    sigma = np.sqrt(np.trace(cut.cov_px2, axis1=1, axis2=2))
    assert (apart < 3.5 * sigma).all() and np.median(apart) < 0.015


@pytest.mark.parametrize("name", AMID)
def test_what_is_not_whole_is_read_too(name: str) -> None:
    """One or several cells are missing: only the markers of these cells are repaired."""
    shot, by = shot_of(name), cached_extractor(name.split("/")[1], 11)
    x, y = shot.truths[0].marker_xy_px[40]
    image = shot.image.copy()
    image[round(y) - 9 : round(y) + 10, round(x) - 9 : round(x) + 10] = 20
    markers = by.extract(image)
    assert not find_wrong_markers(shot, markers)[0].any()
    assert (markers.status != Status.LOST).mean() > 0.97 and (markers.status == Status.MEASURED).mean() > 0.97


def test_fragments_between_scratches_are_no_small_cells() -> None:
    """They are small, but the cells beside them are not."""
    shot = shot_of("scratches=5/honeycomb/0")
    markers = cached_extractor("honeycomb", 11).extract(shot.image)
    assert (markers.status != Status.LOST).mean() > 0.98 and not find_wrong_markers(shot, markers)[0].any()


@pytest.mark.parametrize(
    ("pitch_px", "tilt_deg"),
    [(8, 0), (10, 0), (10, 55), (12, 0), (14, 0), (14, 40), (14, 55), (20, 55), (20, 60)],
)
@pytest.mark.parametrize("pattern", PATTERNS)
def test_no_cell_is_missed_however_small_it_looks_at_a_reduced_scale(
    pattern: str, pitch_px: float, tilt_deg: float
) -> None:
    """Few cells are lost between the size visible at every scale and the size visible at the finest scale only."""
    frame = plain_frame(pattern, 1).with_camera(pitch_px=float(pitch_px), tilt_deg=float(tilt_deg))
    for missing in (0.0, 0.05):
        shot = frame.damaged(missing_share=missing).shoot()
        figures = score_markers(cached_extractor(pattern, 11).extract(shot.image), shot, promised=True)
        assert figures.wrong == 0 and figures.kept >= (0.99 if missing == 0.0 else 0.985) * figures.sure


def test_what_a_reduced_scale_has_missed_is_read_at_a_finer_one() -> None:
    """Scratches leave pieces of cells, which only the finest scale takes for cells: a tenth of the markers is
    concerned.
    """
    figures = read_case(parse_case("random scratches/honeycomb/70210"), 1, timing=False)[0].score
    assert figures.wrong == 0 and figures.kept >= 0.94 * figures.sure
