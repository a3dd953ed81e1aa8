"""The benchmark of video codecs: lossless codecs move no marker, the others move markers by the stated distance."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.codecs.__main__ import main


def test_a_quick_run_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quick", "--json", str(tmp_path / "figures.json")]) == 0
    printed = capsys.readouterr().out
    assert "FFV1" in printed
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    codecs = {one["codec"]: one for one in figures["tables"]["codecs"]}
    for name in ("PNG", "FFV1", "H.264 lossless, RGB"):
        assert codecs[name]["moved"] == codecs[name]["worst"] == 0 and codecs[name]["of PNG"] == 1
    assert 0.01 < codecs["H.264 crf 12, 4:4:4"]["moved"] < codecs["H.264 crf 18"]["moved"]
    assert codecs["H.264 crf 18"]["moved"] < codecs["H.264 crf 23"]["moved"] < 0.3
    assert codecs["H.264 crf 23"]["kB"] < 0.1 * codecs["FFV1"]["kB"]
    assert all(one["lost"] < 0.01 for one in codecs.values())
