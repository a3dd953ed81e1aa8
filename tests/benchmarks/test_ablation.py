"""The ablation of rules: their source texts, copies of the reader without a rule, the measured figures, and the
decision.
"""

from __future__ import annotations

import ast
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from benchmarks.ablation.__main__ import main, try_rules
from benchmarks.ablation.report import comparison_row, merged_rows, rules_table
from benchmarks.suites.ablation.comparison import MIN_LOSS, compare
from benchmarks.suites.ablation.pictures import PatternTruth, keep_pictures, pattern_truth, sampled_cases
from benchmarks.suites.ablation.provoking import CHANGES, FOREIGN, provoking_cases
from benchmarks.suites.ablation.rules import RULES, Rule
from benchmarks.suites.ablation.trial import PictureScore, read_without, score_reading
from benchmarks.suites.ablation.worker import ReadPicture
from benchmarks.suites.code_copy import ROOT, CodeCopy, Replacement, replaced_text
from cmpdesign.scene import standard_layout
from extractor import Status

PIPELINE = "extractor/pipeline.py"
NOTHING = Rule("nothing", "", "accuracy", PIPELINE, "import annotations\n", "import annotations \n")
READING = Rule("reading", "", "accuracy", PIPELINE, "        if pyramid is None:\n", "        if True:\n")
NATIVE_READING = Rule(
    "native reading",
    "",
    "accuracy",
    "extractor/native/image/contrast_maps.cpp",
    "static_cast<std::uint8_t>(((sum * factor) >> 16) + mix.offset)",
    "static_cast<std::uint8_t>(0 * sum * factor)",
)


def score(**fields: float) -> PictureScore:
    usual = {"wrong_ids": 0, "wrong_positions": 0, "lost": 0, "visible": 400, "measured": 400}
    sums = {"squared_px2": 400 * 2 * 0.03**2, "reported": 400, "d2": 800.0, "beyond": 1, "ms": 50.0}
    return PictureScore(**{**usual, **sums, **fields})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> CodeCopy:
    return CodeCopy(tmp_path_factory.mktemp("copy"))


def rule_of(kind: str) -> Rule:
    return next(rule for rule in RULES if rule.kind == kind)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rules_text_occurs_once_and_leaves_a_file_without_it(rule: Rule) -> None:
    text = (ROOT / rule.file).read_text(encoding="utf-8")
    without = replaced_text(text, rule.change)
    if rule.change.is_native:
        assert "".join(without.split()) != "".join(text.split())
    else:
        assert ast.dump(ast.parse(without)) != ast.dump(ast.parse(text))


def test_rules_are_told_apart_by_name() -> None:
    assert len({rule.name for rule in RULES}) == len(RULES)
    assert {rule.kind for rule in RULES} == {"accuracy", "errors and time", "no wrong id"}
    assert {rule.stage for rule in RULES} == {*("pipeline", "cells", "numbering", "refine", "complete")}


def test_a_text_that_occurs_twice_or_never_is_refused() -> None:
    for old, count in (("= 1", 2), ("= 3", 0)):
        with pytest.raises(ValueError, match=f"some.py: the text occurs {count} times"):
            replaced_text("a = 1\nb = 1\n", Replacement("some.py", old, "= 2"))
    assert replaced_text("a = 1\nb = 1\n", Replacement("some.py", "a = 1", "a = 2")) == "a = 2\nb = 1\n"


def test_texts_are_put_back_whatever_happens(copy: CodeCopy) -> None:
    path, old = copy.folder / PIPELINE, (ROOT / PIPELINE).read_text(encoding="utf-8")
    with copy.replaced([NOTHING.change, READING.change]):
        assert path.read_text(encoding="utf-8").count("        if True:\n") == 1 + old.count(
            "        if True:\n"
        )
    assert path.read_text(encoding="utf-8") == old
    with pytest.raises(ValueError, match="0 times"), copy.replaced([READING.change, READING.change]):
        pass
    assert path.read_text(encoding="utf-8") == old


def test_a_rule_that_does_nothing_makes_no_difference_and_one_that_breaks_reading_is_worse(
    tmp_path: Path,
) -> None:
    pictures = list(keep_pictures("plain", 2, 1, tmp_path))
    nothing, reading = try_rules([NOTHING, READING], pictures, "balanced", 1)
    assert nothing.touched == 0 and nothing.verdict == "goes"
    assert [change.difference for change in nothing.judged] == [0, 0, 0, 0]
    visible = sum(int(picture.truths[0].visible.sum()) for picture in pictures)
    assert nothing.rms_px.full > 0 and nothing.lost.full < 0.01 * visible
    assert reading.touched == 2 and reading.lost.without == visible and reading.verdict == "keep"
    table = rules_table([{**comparison_row(one), "seed": 1} for one in (nothing, reading)])
    assert [row["by the figures"] for row in table.records()] == ["goes", "keep"]


def test_a_reader_that_does_not_start_is_an_error_and_no_score(tmp_path: Path, copy: CodeCopy) -> None:
    pictures = list(keep_pictures("plain", 1, 1, tmp_path))
    broken = NOTHING._replace(without="import annotations, nothing\n")
    with pytest.raises(RuntimeError, match="without nothing"):
        read_without((broken,), pictures, "balanced", copy)


@pytest.mark.slow
@pytest.mark.longest
def test_rules_in_cpp_compile_and_are_switched_off_and_on_again(copy: CodeCopy, tmp_path: Path) -> None:
    """Builds the module of the reader, and every file with a rule once more for each of its rules."""
    pictures = list(keep_pictures("plain", 2, 1, tmp_path))
    for rule in RULES:
        if rule.change.is_native:
            with copy.replaced([rule.change]):
                pass
    visible = sum(int(picture.truths[0].visible.sum()) for picture in pictures)
    lost = [
        sum(score.lost for score in read_without(rules, pictures, "balanced", copy))
        for rules in ((), (NATIVE_READING,), (NOTHING,))
    ]
    assert lost[0] < 0.01 * visible and lost[1] == visible and lost[2] == lost[0]


def test_a_rule_stays_if_lost_wrong_or_rms_rise_by_the_least_loss_in_most_pictures() -> None:
    full = [score(lost=100) for _ in range(40)]
    rule = rule_of("accuracy")
    just, below = 100 * (1 + MIN_LOSS), 100 * (1 + 0.9 * MIN_LOSS)
    assert compare(rule, full, [score(lost=just) for _ in full]).verdict == "keep"
    assert compare(rule, full, [score(lost=below) for _ in full]).verdict == "goes"
    assert compare(rule, full, [score(lost=90) for _ in full]).verdict == "goes"
    worse = score(squared_px2=400 * 2 * 0.031**2)
    found = compare(rule, full, [worse] * 40)
    assert found.rms_px.full == pytest.approx(0.03) and found.rms_px.without == pytest.approx(0.031)
    assert found.typical_px.difference == pytest.approx(0.001) and found.z == (1.0, 1.0)
    assert found.verdict == "keep"
    assert compare(rule, full, [score(wrong_positions=1) for _ in full]).verdict == "keep"


def test_a_loss_in_one_picture_of_many_is_chance() -> None:
    full = [score(lost=10) for _ in range(40)]
    without = [score(lost=10 + (300 if number == 7 else 0)) for number in range(40)]
    found = compare(rule_of("accuracy"), full, without)
    assert found.lost.difference == 300 and found.lost.low == 0 and found.verdict == "goes"


def test_intervals_are_of_paired_differences() -> None:
    rng = np.random.default_rng(3)
    level = rng.integers(0, 1000, 200)
    full = [score(lost=int(a)) for a in level]
    without = [score(lost=int(a) + int(b)) for a, b in zip(level, rng.integers(0, 3, 200), strict=True)]
    found = compare(rule_of("accuracy"), full, without).lost
    deviation = np.sqrt(200 * 2 / 3)  # of a sum of 200 numbers 0, 1, 2
    assert 0.5 * 2 * 1.96 * deviation < found.high - found.low < 1.5 * 2 * 1.96 * deviation
    assert found.low < found.difference < found.high


def test_a_rule_against_wrong_ids_stays_if_it_saves_one_and_costs_fewer() -> None:
    rule, full = rule_of("no wrong id"), [score() for _ in range(30)]
    one = [score(wrong_ids=int(number == 3)) for number in range(30)]
    assert compare(rule, full, one).verdict == "keep" and compare(rule, one, full).verdict == "goes"
    assert compare(rule, full, [score(lost=50) for _ in full]).verdict == "keep"
    assert compare(rule_of("accuracy"), full, one).verdict == "keep"


@pytest.mark.parametrize("worse", [{"d2": 900.0}, {"d2": 700.0}, {"beyond": 2}, {"ms": 52.0}])
def test_a_rule_for_true_errors_or_time_stays_if_z_or_time_are_worse(worse: dict[str, float]) -> None:
    full, without = [score() for _ in range(30)], [score(**worse) for _ in range(30)]
    assert compare(rule_of("errors and time"), full, without).verdict == "keep"
    assert compare(rule_of("accuracy"), full, without).verdict == "goes"
    assert compare(rule_of("errors and time"), full, [score(ms=40.0, d2=790.0)] * 30).verdict == "goes"


def test_wrong_ids_and_wrong_positions_are_counted_apart() -> None:
    layout = standard_layout("honeycomb", 4)
    true_px = 100 + 20 * layout.marker_xy_mm
    truth = pattern_truth(layout, true_px, np.ones(len(true_px), np.bool_), (480, 640, 3))
    np.testing.assert_allclose(truth.edge_px, 20)
    xy, status = true_px + [0.03, -0.04], np.full(len(true_px), Status.MEASURED)
    xy[5], xy[9] = true_px[6] + 1, true_px[9] + [0, 11]
    xy[20], status[20], status[30] = np.nan, Status.LOST, Status.REPAIRED
    cov = np.broadcast_to(0.05**2 * np.eye(2), (len(xy), 2, 2))
    found = score_reading(ReadPicture(xy, cov, status, 1.0), [truth])
    assert (found.wrong_ids, found.wrong_positions, found.lost) == (1, 1, 1)
    assert found.measured == len(xy) - 4
    assert found.squared_px2 == pytest.approx(0.05**2 * found.measured)
    assert found.reported == found.measured + 1 and found.d2 == pytest.approx(found.reported)


def test_the_pattern_that_was_read_is_the_one_with_fewest_wrong_markers() -> None:
    layout = standard_layout("honeycomb", 2)
    seen = np.ones(len(layout.marker_xy_mm), np.bool_)
    left, right = (
        pattern_truth(layout, x + 20 * layout.marker_xy_mm, seen, (480, 640, 3)) for x in (100, 400)
    )
    cov = np.broadcast_to(np.eye(2), (len(seen), 2, 2))
    reading = ReadPicture(right.xy_px, cov, np.full(len(seen), Status.MEASURED), 1.0)
    assert score_reading(reading, [left, right]).wrong == 0
    assert score_reading(reading, [left]).wrong == len(seen)
    assert score_reading(reading, ()).wrong_ids == len(seen)


def test_markers_outside_a_smaller_pattern_are_unknown() -> None:
    small, large = standard_layout("honeycomb", 2), standard_layout("honeycomb", 3)
    truth: PatternTruth = pattern_truth(large, 50 + 5 * small.marker_xy_mm, None, (100, 100, 3))
    assert truth.visible.sum() == len(small.marker_xy_mm) and np.isnan(truth.xy_px[-1]).all()


def test_pictures_made_to_provoke_are_of_all_kinds_and_repeat_with_the_seed() -> None:
    kinds = (*CHANGES, FOREIGN)
    cases = list(islice(provoking_cases(4), 2 * len(kinds)))
    assert [case.kind for case in cases] == [*kinds, *kinds]
    assert {case.layout.pattern for case in cases} == {"honeycomb", "round"}
    swapped = cases[kinds.index("swapped cells")].shoot().image
    again = list(islice(provoking_cases(4), 3))[2].shoot().image
    other = list(islice(provoking_cases(5), 3))[2].shoot().image
    assert (swapped == again).all() and (swapped != other).any()
    assert cases[kinds.index(FOREIGN)].shoot().truths == ()


def test_a_suites_pictures_are_drawn_from_all_of_it() -> None:
    some = sampled_cases("damage", 30, 2)
    assert len(some) == 30 and {"blots", "random blobs"} < {
        case.kind for case in sampled_cases("damage", 200, 2)
    }
    assert [case.kind for case in sampled_cases("damage", 30, 3)] != [case.kind for case in some]


def test_a_rules_row_replaces_that_of_the_same_seed_and_stands_beside_the_others() -> None:
    first = [{"rule": "a", "seed": 1, "lost": 0}, {"rule": "b", "seed": 1, "lost": 1}]
    second = [{"rule": "a", "seed": 2, "lost": 2}, {"rule": "b", "seed": 1, "lost": 3}]
    assert merged_rows(first, second) == [first[0], *second]


def test_the_command_lists_its_rules_and_refuses_no_pictures(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert len(listed) == len(RULES) + 2 and all(rule.purpose in listed[n] for n, rule in enumerate(RULES))
    with pytest.raises(SystemExit):
        main(["--pictures", "0"])
    assert "it must be 1 or more" in capsys.readouterr().err
