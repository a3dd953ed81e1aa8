"""Recordings that do not fit on the disk: nothing half-written has their name, and their frames are recovered."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, write_moving_pattern

LIMITED = """
import resource, sys
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
from cmpdesign.cli import main
main()
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def counts_of(path: Path) -> dict[str, int]:
    """The number of messages of each topic; all of the file is read."""
    counts: dict[str, int] = {}
    with path.open("rb") as file:
        for _, channel, _ in make_reader(file).iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    return counts


@pytest.mark.parametrize("name", ["a.mcap", "a_bag"])
def test_what_does_not_fit_is_kept_in_pieces_and_recovered(name: str, made: Path, tmp_path: Path) -> None:
    arguments = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / name)
    options = ("--with-images", "--frame-id", "thumb")
    command = [sys.executable, "-c", LIMITED, "400000", *map(str, (*arguments, *options))]
    limited = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert limited.returncode == 2 and f"{FRAMES} frames are kept in" in limited.stderr, limited.stderr
    part = tmp_path / f"{name}.part"
    assert not (tmp_path / name).exists() and "--recover" in refused(*arguments)
    assert not list(tmp_path.glob(".cmpdesign-*"))
    cut = part / f"{3:09d}.png"
    cut.write_bytes(cut.read_bytes()[:-1])  # as after a loss of power
    result = run(*arguments, "--recover")
    assert result.exit_code == 0 and f"{FRAMES} frames recovered" in result.stdout
    found = counts_of(tmp_path / name if name.endswith(".mcap") else tmp_path / name / f"{name}.mcap")
    assert found["/thumb/markers"] == found["/diagnostics"] == FRAMES
    assert found["/thumb/image_raw/compressed"] == found["/thumb/camera_info"] == FRAMES - 1
    assert not part.exists()
