"""A cut of the stress suite: no marker is ever wrong, nothing is read where nothing is, and the promise is kept.

The whole suite is ``python -m benchmarks.stress``; it runs here, too, marked slow.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.stress.__main__ import main
from benchmarks.suites.scoring.calibration import calibration_table
from benchmarks.suites.scoring.reading import CaseResult, cached_extractor, read_case
from benchmarks.suites.scoring.report import (
    PROMISED_SHARE,
    by_condition,
    failure_lines,
    results_table,
)
from benchmarks.suites.scoring.score import score_markers, smallest_contrast
from benchmarks.suites.scoring.squares import MEASURED, calibrations_by_position
from benchmarks.suites.stress.conditions import BY_NAME, KINDS, make_cases
from benchmarks.suites.stress.frames import PATTERNS, CaseImage, plain_frame
from benchmarks.suites.stress.kinds import ConditionKind, StressCase, make_frame
from extractor import Markers, Status

STANDARD_STEPS = ("megapixels", "small cells", "medium cells", "large cells")  # whose later steps are large
EMPTY_IMAGES = 4  # of every kind
# Known shortfalls, in shares of the promised markers.
LESS_KEPT = {
    "overflowing": 0.98,  # two of 183: large cells, and corners 3 px from the image's rim are lost
    "saturation": 0.97,  # clipped inks move the acute corners of the rim by 3 px: they are dropped, or fitted
    "glare": 0.98,  # where its rim crosses gridlines, profiles and triangles disagree
}


def hard_but_promised(kind: ConditionKind) -> float:
    """The step in the middle: hard enough to show differences, mild enough for the stated limit."""
    return kind.steps[0] if kind.name in STANDARD_STEPS else kind.steps[len(kind.steps) // 2]


def cut() -> list[StressCase]:
    """One image of every kind of condition, the patterns in turn."""
    chosen = []
    for number, kind in enumerate(kind for kind in KINDS if kind.group != "nothing"):
        turn = number % len(PATTERNS)
        chosen.append(StressCase(kind.name, hard_but_promised(kind), PATTERNS[turn], 100 * turn))
    return chosen


def result_of(case: StressCase) -> CaseResult:
    return read_case(case, runs=1, timing=False)[0]


@pytest.mark.parametrize("case", cut(), ids=lambda case: case.name)
def test_no_marker_is_wrong_and_the_promise_is_kept(case: StressCase) -> None:
    figures = result_of(case).score
    assert figures.wrong == 0
    assert figures.outside == 0
    assert not figures.promised or figures.kept >= LESS_KEPT.get(case.kind, PROMISED_SHARE) * figures.sure


def test_a_blur_far_from_the_first_estimate_is_drawn_anew() -> None:
    """The rims of bled inks look a third more blurred than their middles; with the smaller blur, markers of the rim are
    lost.
    """
    figures = result_of(StressCase("bleeding inks", 0.1, "elliptical", 200)).score
    assert figures.wrong == 0 and figures.kept >= PROMISED_SHARE * figures.sure


@pytest.mark.parametrize("kind", [kind.name for kind in KINDS if kind.group == "nothing"])
def test_nothing_is_read_where_nothing_is(kind: str) -> None:
    steps = BY_NAME[kind].steps
    for image in range(EMPTY_IMAGES):
        # Odd seeds make small images.
        case = StressCase(kind, steps[image % len(steps)], PATTERNS[image % len(PATTERNS)], 1001 + 2 * image)
        assert result_of(case).score.reported == 0, case.name


def test_the_suite_is_as_large_as_it_says() -> None:
    full = make_cases(quick=False)
    assert len(KINDS) == len(BY_NAME) >= 60
    assert len(set(full)) == len(full)
    assert {case.pattern for case in full} == set(PATTERNS)
    assert sum(BY_NAME[case.kind].group == "nothing" for case in full) >= 1000


def perfect() -> tuple[Markers, CaseImage]:
    """The plain frame, and markers made from its truth."""
    shot = plain_frame("honeycomb", 0).shoot()
    found = cached_extractor("honeycomb", 11).extract(np.zeros_like(shot.image))
    visible = shot.truths[0].visible
    xy_px = np.where(visible[:, None], shot.truths[0].marker_xy_px, np.nan)
    return replace(found, xy_px=xy_px, status=visible.astype(np.uint8)), shot


def test_the_score_sees_swapped_shifted_and_lost_markers() -> None:
    markers, shot = perfect()
    good = score_markers(markers, shot, promised=True)
    assert (good.wrong, good.lost, good.outside, good.hidden) == (0, 0, 0, 0)
    assert good.promised and good.kept == good.sure == good.measured == good.visible
    assert good.rms_px == 0

    swapped = markers.xy_px.copy()
    swapped[[3, 4]] = swapped[[4, 3]]
    assert score_markers(replace(markers, xy_px=swapped), shot, promised=True).wrong == 2
    for share, wrong in ((0.29, 0), (0.31, 1)):
        moved = markers.xy_px.copy()
        moved[7] += [20 * share, 0]
        assert score_markers(replace(markers, xy_px=moved), shot, promised=True).wrong == wrong
    status = markers.status.copy()
    status[:5] = Status.LOST
    status[5] = Status.FITTED
    some = score_markers(replace(markers, status=status), shot, promised=True)
    assert (some.lost, some.fitted, some.kept) == (5, 1, good.kept - 6)


def test_a_reported_marker_without_a_place_is_wrong() -> None:
    markers, shot = perfect()
    xy_px = markers.xy_px.copy()
    xy_px[0] = np.nan
    assert score_markers(replace(markers, xy_px=xy_px), shot, promised=True).wrong == 1


def test_markers_on_an_empty_image_are_wrong_and_reported_as_such() -> None:
    markers, shot = perfect()
    figures = score_markers(markers, CaseImage(shot.image, (), None), promised=False)
    assert figures.wrong == figures.reported == int((markers.status > 0).sum())
    case = StressCase("nothing: noise", 1, "honeycomb", 0)
    conditions = by_condition([CaseResult(case, figures, 10.0, 1.0, "", False)])
    assert failure_lines(conditions)[0].startswith("WRONG")


def test_errors_over_covariances_are_stated() -> None:
    """Of a condition with a pattern in a row and a table; of one without, none."""
    cases = [StressCase("plain", 0, "honeycomb", 0), StressCase("nothing: noise", 1, "honeycomb", 0)]
    results = [result_of(case) for case in cases]
    shown = results_table(by_condition(results)).records()
    stated = calibrations_by_position([result.squares for result in results])
    assert shown[0]["z"] == stated[MEASURED].z.value and np.isnan(shown[1]["z"])
    assert stated[MEASURED].count == results[0].score.measured
    assert "virtual, measured" in str(calibration_table("", stated))


def test_the_virtual_markers_of_a_second_pattern_lie_on_it() -> None:
    first, second = (
        make_frame(StressCase("two alike", 20, "honeycomb", 0), BY_NAME["two alike"]).shoot().truths
    )
    for truth in (first, second):
        low, high = truth.marker_xy_px.min(axis=0), truth.marker_xy_px.max(axis=0)
        virtual_px = truth.virtual_xy_px.reshape(-1, 2)
        assert ((virtual_px >= low) & (virtual_px <= high)).all()
    assert second.marker_xy_px[0, 0] > first.marker_xy_px[:, 0].max()


def test_two_patterns_may_be_read_as_either_but_not_mixed() -> None:
    markers, shot = perfect()
    far = replace(shot.truths[0], marker_xy_px=shot.truths[0].marker_xy_px + 700.0)
    both = replace(shot, truths=(far, shot.truths[0]))
    assert score_markers(markers, both, promised=True).wrong == 0
    mixed = markers.xy_px.copy()
    mixed[:10] += 700
    assert score_markers(replace(markers, xy_px=mixed), both, promised=True).wrong == 10


@pytest.mark.parametrize(
    ("kind", "step", "promised"),
    [
        ("pitch", 6, False),
        ("pitch", 10, True),
        ("blur", 4, True),
        ("blur small edge", 1.5, True),
        ("blur large edge", 8, True),
        ("contrast and noise", 60, False),
        ("contrast and noise", 80, True),
        ("contrast and noise", 120, True),
        ("white cell missing", 0, False),
        ("two alike", 20, False),
    ],
)
def test_the_promise_applies_as_stated(kind: str, step: float, promised: bool) -> None:
    assert result_of(StressCase(kind, step, "honeycomb", 0)).score.promised is promised


def test_contrast_is_the_weakest_cells_under_its_light() -> None:
    shot = plain_frame("honeycomb", 0).shoot()
    assert shot.scene is not None
    size = (shot.image.shape[1], shot.image.shape[0])
    assert smallest_contrast(shot.scene, shot.truths[0], size) == 130  # green: 150 on 20
    dim = plain_frame("honeycomb", 0).with_light(rgb=(0.5, 0.5, 0.5))
    assert smallest_contrast(dim.scene, shot.truths[0], size) == 65


@pytest.mark.slow
def test_the_whole_suite() -> None:
    assert main([]) == 0
