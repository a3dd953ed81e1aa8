"""The benchmark of live viewers: every frame reaches a client that reads, and a client that does not read delays no
frame.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.live.run import main


@pytest.mark.slow
def test_a_quick_run_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quick", "--json", str(tmp_path / "figures.json")]) == 0
    printed = capsys.readouterr().out
    assert "foxglove" in printed and "…" not in printed
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    reads, stalled, fastest = figures["streams"]
    assert reads["seen"] == reads["sent"] > 300 and stalled["sent"] > 300 and stalled["seen"] == 0
    assert fastest["seen"] == fastest["sent"] and fastest["rate_hz"] > 120
    assert all(one["left_out"] == 0 and one["largest_queue"] <= 32 for one in figures["streams"])
    assert all(one["held_up_ms"] < 1 for one in figures["costs"] if one["output"] in ("foxglove", "rerun"))
