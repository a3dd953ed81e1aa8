"""The command of calibration: its suites, its rows, and that parts of a suite are the suite."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.calibration.__main__ import main
from benchmarks.frame.conditions import commit_seed
from benchmarks.frame.parallel import results_of
from benchmarks.suites.calibration.damaged import DAMAGE_KINDS, MILD_KINDS
from benchmarks.suites.calibration.plain import scattered_layout
from benchmarks.suites.calibration.reading import SuiteJob, calibrations_by_suite, in_order, read_pictures
from benchmarks.suites.calibration.suites import suites_by_name, usual_seed
from benchmarks.suites.camera.cases import KINDS
from benchmarks.suites.scoring.squares import POSITIONS, nearest_truth, picture_squares
from benchmarks.suites.stress.frames import PATTERNS, plain_frame
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import standard_layout
from extractor import Extractor, Status, parse_layout


def kinds_of(suite: str) -> list[str]:
    return list(dict.fromkeys(case.kind for case in suites_by_name()[suite](True, 0)))


def test_suites_have_their_kinds_in_all_patterns() -> None:
    assert list(suites_by_name()) == [
        "plain", "mild dirt", "damage", "stress", "scatter", "camera",
    ]  # fmt: skip
    plain = list(suites_by_name()["plain"](True, 0))
    assert len({case.kind for case in plain}) == 8 and {case.layout.pattern for case in plain} == set(
        PATTERNS
    )
    assert kinds_of("mild dirt") == list(MILD_KINDS) and kinds_of("damage") == list(DAMAGE_KINDS)
    assert kinds_of("scatter") == ["0.05 px", "0.2 px", "0.5 px"]
    full = list(suites_by_name()["damage"](False, 0))
    assert len(full) == 108


def test_a_seed_gives_the_same_pictures_and_another_seed_others() -> None:
    first, again, other = (
        next(suites_by_name()["mild dirt"](True, seed)).shoot().image for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_markers_are_scattered_as_stated() -> None:
    layout = standard_layout("honeycomb", 11)
    moved = scattered_layout(layout, 0.01, np.random.default_rng(0))
    off = moved.marker_xy_mm - layout.marker_xy_mm
    assert off.std() == pytest.approx(0.01, rel=0.1) and abs(off.mean()) < 0.001
    np.testing.assert_array_equal(moved.edges, layout.edges)


def test_squares_are_of_each_status_and_of_the_pattern_that_was_read() -> None:
    frame = plain_frame("honeycomb", 3, layers=4)
    shot = frame.shoot()
    markers = Extractor(parse_layout(layout_to_json(frame.layout))).extract(shot.image)
    status = markers.status.copy()
    status[:4] = Status.LOST, Status.REPAIRED, Status.FITTED, Status.FITTED
    markers = replace(markers, status=status)
    truth = shot.truths[0]
    far = replace(truth, marker_xy_px=truth.marker_xy_px + 700.0, virtual_xy_px=truth.virtual_xy_px + 700.0)
    assert nearest_truth(markers, (far, truth)) is truth
    found = picture_squares(markers, truth)
    counts = [len(found[name]) for name in POSITIONS]
    assert counts[1:3] == [1, 2] and counts[0] == (status == Status.MEASURED).sum()
    assert sum(counts[3:]) == (markers.virtual_status > 0).sum()
    error = truth.virtual_xy_px - markers.virtual_xy_px
    twice = replace(markers, virtual_xy_px=markers.virtual_xy_px - error)
    np.testing.assert_allclose(
        picture_squares(twice, truth)["virtual, measured"], 4 * found["virtual, measured"]
    )


def test_parts_of_a_suite_are_the_suite() -> None:
    jobs = [SuiteJob("scatter", ("balanced",), True, 0, part, 2) for part in range(2)]
    apart, whole = (
        in_order(results_of(read_pictures, jobs, 1)),
        read_pictures(SuiteJob("scatter", ("balanced",), True)),
    )
    assert [reading.number for reading in apart] == [reading.number for reading in whole] == list(range(9))
    found = calibrations_by_suite(whole)["balanced, scatter"]
    assert calibrations_by_suite(apart)["balanced, scatter"] == found
    kinds = [one.count for name, one in found.items() if name.endswith("px: measured")]
    assert len(kinds) == 3 and found["together: measured"].count == sum(kinds)


def test_the_camera_suite_has_all_effects_and_the_commits_seed() -> None:
    assert kinds_of("camera") == list(KINDS)
    assert usual_seed("camera") == commit_seed() and usual_seed("plain") == 0
    cases = suites_by_name()["camera"]
    first, again, other = (next(cases(True, seed)).shoot() for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.image, again.image)
    assert (first.image != other.image).any()


def test_markers_and_virtual_markers_of_cameras_lie_where_their_truth_says() -> None:
    """An undisturbed picture, and one that is distorted: there gridlines are curved."""
    cases = list(suites_by_name()["camera"](True, 5))
    for kind in ("none", "distortion"):
        case = next(case for case in cases if case.kind == kind)
        shot = case.shoot()
        markers = Extractor(parse_layout(layout_to_json(case.layout))).extract(shot.image)
        found = picture_squares(markers, shot.truths[0])
        for position in ("measured", "virtual, measured"):
            assert len(found[position]) > 100 and np.median(found[position]) < 4


def test_a_quick_run_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "rows.json"
    arguments = ["--quick", "--preset", "balanced", "--suite", "scatter", "--processes", "1"]
    assert main([*arguments, "--json", str(out)]) == 0
    text = capsys.readouterr().out
    assert "0.5 px: virtual, measured" in text and "9 pictures, seed of scatter 0" in text
    written = json.loads(out.read_text(encoding="utf-8"))
    rows = {row["errors over covariances"]: row for row in written["tables"]["balanced, scatter"]}
    assert {name.partition(":")[0] for name in rows} == {"0.05 px", "0.2 px", "0.5 px", "together"}
    row = rows["together: measured"]
    assert row["pictures"] == 9 and row["singular"] == 0
    assert row["z, 95 %"][0] <= row["z"] <= row["z, 95 %"][1]
    with pytest.raises(SystemExit):
        main(["--suite", "nothing"])
