"""Wrong positions against lost markers: the bound, what holds, and that a narrower threshold loses markers."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest

from benchmarks.acceptance.__main__ import THRESHOLDS, curve, keep_all
from benchmarks.acceptance.points import Point, pooled_point, upper_share
from benchmarks.frame.conditions import ROOT
from benchmarks.suites.ablation.trial import PictureScore
from benchmarks.suites.code_copy import replaced_text


def test_the_bound_of_nothing_wrong_is_three_over_the_count_and_rises_with_what_is_wrong() -> None:
    assert upper_share(0, 300_000) == pytest.approx(3 / 300_000, rel=0.01)
    # of 3 wrong, the Poisson bound is 7.754
    assert upper_share(3, 448_182) == pytest.approx(7.754 / 448_182, rel=0.001)
    assert upper_share(5, 5) == 1.0


def test_a_threshold_holds_without_wrong_ids_below_the_bound_and_with_few_more_lost() -> None:
    own = Point(0.15, 400_000, 0, 0, 10_000, 420_000)
    assert own.holds(own)
    assert own._replace(lost=10_500).holds(own)
    assert not own._replace(lost=10_501).holds(own)
    assert not own._replace(wrong_positions=1).holds(own)  # a bound of 11.9
    assert not own._replace(wrong_ids=1).holds(own)
    assert not own._replace(reported=200_000).holds(own)


@pytest.mark.parametrize("name", THRESHOLDS)
def test_the_readers_own_value_is_found_in_its_source_and_replaced(name: str) -> None:
    threshold = THRESHOLDS[name]
    assert min(threshold.values) < threshold.own_value() < max(threshold.values)
    text = (ROOT / threshold.file).read_text(encoding="utf-8")
    for value in threshold.values:
        changed = replaced_text(text, threshold.change(value))
        assert f"{threshold.field} = {value:g};" in changed and len(changed.split()) == len(text.split())


def test_a_point_sums_its_pictures() -> None:
    score = PictureScore(1, 2, 7, 400, 380, 0.5, 390, 800.0, 1, 5.0)
    point = pooled_point(0.15, [score, score._replace(wrong_ids=0, lost=3)])
    assert point == Point(
        0.15, reported=390 + 3 + 390 + 2, wrong_ids=1, wrong_positions=4, lost=10, visible=800
    )


@pytest.mark.slow
@pytest.mark.longest
def test_a_narrow_threshold_loses_markers(tmp_path: Path) -> None:
    """Builds the module of the reader."""
    pictures = list(islice(keep_all(2, 4, tmp_path), 2))
    narrow, own = curve(THRESHOLDS["max_distance"], (0.001, 0.14), pictures)
    assert narrow.lost > own.lost
    assert narrow.visible == own.visible > 0
