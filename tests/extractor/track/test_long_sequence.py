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
def test_the_benchmark_prints_writes_and_draws(tmp_path: Path) -> None:
    out, plot = tmp_path / "figures.json", tmp_path / "plot.png"
    options = ["--quick", "--json", str(out), "--plot", str(plot)]
    command = [sys.executable, "-m", "benchmarks.tracking", *options]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr
    assert "2nd half / 1st" in result.stdout and "…" not in result.stdout
    assert plot.read_bytes().startswith(b"\x89PNG")
    for sequence in json.loads(out.read_text(encoding="utf-8"))["sequences"]:
        assert sum(block["wrong"] for block in sequence["blocks"]) == 0
        assert sum(block["flow_rms_px"] > block["rms_px"] for block in sequence["blocks"]) == len(
            sequence["blocks"]
        )
        assert (
            sequence["warm_frames"] + sequence["cold_frames"] + sequence["not_tracked"] == sequence["frames"]
        )
