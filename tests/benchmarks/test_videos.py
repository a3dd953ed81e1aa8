"""The benchmarks of video: lossless codecs move no marker, and every frame reaches a live client that reads."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.codecs.__main__ import main as codecs_main
from benchmarks.live.__main__ import main


@pytest.mark.slow
def test_a_client_that_does_not_read_delays_no_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--quick", "--json", str(tmp_path / "figures.json")]) == 0
    printed = capsys.readouterr().out
    assert "foxglove" in printed
    tables = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))["tables"]
    reads, stalled, fastest = tables["streams into Foxglove"]
    assert reads["seen"] == reads["sent"] > 300 and stalled["sent"] > 300 and stalled["seen"] == 0
    assert fastest["seen"] == fastest["sent"] and fastest["Hz"] > 120
    assert all(one["left out"] == 0 and one["queue"] <= 32 for one in (reads, stalled, fastest))
    assert all(one["held up ms"] < 1 for one in tables["outputs"] if one["output"] in ("foxglove", "rerun"))


def test_lossless_codecs_move_no_marker(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert codecs_main(["--quick", "--json", str(tmp_path / "figures.json")]) == 0
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
