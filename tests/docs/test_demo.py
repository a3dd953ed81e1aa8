"""The demo: its run, and its figures for correct and wrong results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmpdesign import demo
from tests.support.verdicts import markers_at, picture

README = Path(__file__).parents[2] / "README.md"


def test_the_demo_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert demo.main() == 0
    words = capsys.readouterr().out.split()
    table = words[words.index("against") :]
    for row, expected in (("visible", "331"), ("measured", "331"), ("lost", "0"), ("ids", "0")):
        assert table[table.index(row) + 1] == expected
    error = table[table.index("axis") + 1]
    assert 0 < float(error) < 0.05
    assert f"{error} px RMS error per axis" in README.read_text(encoding="utf-8")
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written >= {
        "pattern.svg",
        "layout.json",
        "sample.png",
        "truth.npz",
        "sample.overlay.png",
        "verify.json",
    }


def test_the_truth_scores_full_marks() -> None:
    truth = picture().truth
    figures = demo.score_markers(markers_at(truth.marker_xy_px), truth)
    assert (figures.visible, figures.measured, figures.lost, figures.wrong) == (61, 61, 0, 0)
    assert figures.rms_px == figures.max_px == 0


def test_errors_wrong_ids_and_repairs_are_counted() -> None:
    truth = picture().truth
    xy_px = truth.marker_xy_px + (0.3, -0.1)
    xy_px[[7, 8]] = xy_px[[8, 7]]
    xy_px[20] = np.nan
    markers = markers_at(xy_px)
    status = markers.status.copy()
    status[[7, 8]], status[9] = 2, 3
    figures = demo.score_markers(replace(markers, status=status), truth)
    assert (figures.measured, figures.repaired, figures.lost, figures.wrong) == (57, 3, 1, 2)
    assert figures.rms_px == pytest.approx(np.sqrt((0.09 + 0.01) / 2))
    assert figures.max_px == pytest.approx(np.hypot(0.3, 0.1))
