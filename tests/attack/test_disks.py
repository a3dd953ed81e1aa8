"""Full disks, killed runs and the environment: what was written stays, what is lost is said."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from cmpdesign import OutputError
from cmpdesign.files.atomic import Stage
from cmpdesign.tracking.sinks import chunk_sink
from tests.support.command import run
from tests.support.tracking.files import FRAMES, write_moving_pattern


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def tracked(made: Path, output: Path, *words: object) -> tuple[object, ...]:
    return "track", made / "layout.json", made / "video.avi", "-o", output, "--with-images", *words


def failed(*words: object) -> str:
    """The line on standard error of a run that ends with exit code 2."""
    result = run(*words)
    assert result.exit_code == 2, result.output
    (line,) = (line for line in result.stderr.splitlines() if line.startswith("error: "))
    return line


@pytest.mark.parametrize("fitting", [0, 3])
def test_a_disk_that_fills_with_images_keeps_the_frames(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fitting: int
) -> None:
    """The disk is full after some images; the frames of all of them were on disk before."""
    written: list[int] = []
    keep = chunk_sink.keep_images

    def keep_some(folder: Path, frame: int, image: Any) -> None:
        if len(written) >= fitting:
            raise OSError(28, "No space left on device")
        keep(folder, frame, image)
        written.append(frame)

    monkeypatch.setattr(chunk_sink, "keep_images", keep_some)
    line = failed(*tracked(made, tmp_path / "a.mcap"))
    assert (
        "No space left on device" in line and f"{FRAMES} frames are kept in" in line and "--recover" in line
    )
    assert not (tmp_path / "a.mcap").exists()
    assert len(list((tmp_path / "a.mcap.part").glob("*.png"))) == fitting
    result = run(*tracked(made, tmp_path / "a.mcap", "--recover"))
    assert f"{FRAMES} frames recovered" in result.stdout
    if fitting:
        assert f"{FRAMES - fitting} of {FRAMES} frames have no image" in result.stderr + result.stdout


def test_a_disk_that_is_full_at_once_keeps_nothing_and_says_so(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(chunk_sink, "save_chunk", full)
    line = failed(*tracked(made, tmp_path / "a.mcap"))
    assert "no frame is kept" in line and "--recover" not in line
    assert not list((tmp_path / "a.mcap.part").glob("*.png"))
    monkeypatch.undo()
    assert run(*tracked(made, tmp_path / "a.mcap")).exit_code == 0


@pytest.mark.slow
def test_large_images_wait_for_their_chunk_in_little_memory(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chunk_sink, "CHUNK_IMAGE_BYTES", 1)
    result = run(*tracked(made, tmp_path / "a.mcap"))
    assert result.exit_code == 0 and f"{FRAMES} tracked" in result.stdout, result.output


def test_a_stage_is_removed_while_a_thread_still_writes_into_it(tmp_path: Path) -> None:
    """As threads of zarr do after an error of one of them."""
    writing = threading.Event()

    def write(folder: Path) -> None:
        for number in range(60):
            folder.mkdir(exist_ok=True)
            (folder / str(number)).write_bytes(b"0")
            writing.set()
            time.sleep(0.002)

    try:
        with Stage(tmp_path) as stage:
            thread = threading.Thread(target=_until_refused, args=(write, stage.folder / "buffer"))
            thread.start()
            writing.wait(5)
            raise OutputError("full")
    except OutputError:
        pass
    thread.join()
    assert list(tmp_path.iterdir()) == []


def _until_refused(write: Any, folder: Path) -> None:
    try:
        write(folder)
    except OSError:
        return


@pytest.mark.parametrize("date", ["1700000000", pytest.param("no date", marks=pytest.mark.slow)])
def test_a_sheet_does_not_depend_on_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, date: str
) -> None:
    words = ("build", "honeycomb", "--only", "print", "--set", "layers=3", "--set", "pitch_mm=4", "-o")
    assert run(*words, tmp_path / "a").exit_code == 0
    monkeypatch.setenv("SOURCE_DATE_EPOCH", date)
    assert run(*words, tmp_path / "b").exit_code == 0
    assert os.environ["SOURCE_DATE_EPOCH"] == date
    first, second = (sorted((tmp_path / name).rglob("*.pdf")) for name in ("a", "b"))
    assert first and [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
