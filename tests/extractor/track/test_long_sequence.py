"""No drift in a long sequence of large motion, and the benchmark that compares the drift with optical flow."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from extractor import FrameStatus, StartKind, Tracker
from tests.support.tracking.scenes import errors, moving, reference

ROOT = Path(__file__).parents[3]
FRAMES = 2000


@pytest.mark.slow
def test_two_thousand_frames_without_a_wrong_id_or_a_growing_error() -> None:
    tracker = Tracker(reference())
    squares, starts = [], []
    for index, rendered in enumerate(moving(FRAMES)):
        frame = tracker.track(rendered.image, time_s=index / 30)
        away = errors(frame.markers.xy_px, rendered)
        assert frame.status is FrameStatus.TRACKED and len(away) == 91 and away.max() < 1.5
        squares.append(np.mean(away**2))
        starts.append(frame.start)
    quarter = FRAMES // 4
    assert np.mean(squares[-quarter:]) < 1.1 * np.mean(squares[:quarter])
    assert starts.count(StartKind.WARM) > 0.95 * FRAMES


@pytest.mark.slow
def test_the_benchmark_prints_and_writes(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    command = [sys.executable, "-m", "benchmarks.tracking", "--quick", "--json", str(out)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr
    assert "2nd half / 1st" in result.stdout
    tables = json.loads(out.read_text(encoding="utf-8"))["tables"]
    for name, rows in tables.items():
        if name.endswith("times"):
            assert (
                sum(row["frames"] for row in rows if row["start"] in ("warm", "cold", "not tracked")) == 120
            )
            continue
        blocks = rows[:-1]
        assert sum(row["wrong ids"] for row in blocks) == 0
        assert all(row["flow: RMS px"] > row["RMS px"] for row in blocks)
