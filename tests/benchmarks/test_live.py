"""The benchmark of live viewers: every frame reaches a client that reads, and a client that does not read delays no
frame.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.live.__main__ import main


@pytest.mark.slow
def test_a_quick_run_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quick", "--json", str(tmp_path / "figures.json")]) == 0
    printed = capsys.readouterr().out
    assert "foxglove" in printed
    tables = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))["tables"]
    reads, stalled, fastest = tables["streams into Foxglove"]
    assert reads["seen"] == reads["sent"] > 300 and stalled["sent"] > 300 and stalled["seen"] == 0
    assert fastest["seen"] == fastest["sent"] and fastest["Hz"] > 120
    assert all(one["left out"] == 0 and one["queue"] <= 32 for one in (reads, stalled, fastest))
    assert all(one["held up ms"] < 1 for one in tables["outputs"] if one["output"] in ("foxglove", "rerun"))
