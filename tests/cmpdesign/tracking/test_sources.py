"""Sources of frames that end early, are damaged or live: videos, folders, cameras and streams."""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import cv2
import numpy as np
import pytest

from cmpdesign.tracking.sources import SourceError, open_source
from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, MARKERS, loaded, rows_of, write_moving_pattern


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def test_a_truncated_video_keeps_its_frames(made: Path, tmp_path: Path) -> None:
    data = (made / "video.avi").read_bytes()
    cut = tmp_path / "cut.avi"
    cut.write_bytes(data[: int(0.6 * len(data))])
    result = run("track", made / "layout.json", cut, "-o", tmp_path / "a.npz")
    assert result.exit_code == 1 and "s of the 0.96 s that it states" in result.stderr
    table = loaded(tmp_path / "a.npz")
    read = len(table["frame"])
    assert 10 <= read < FRAMES
    good = table["frame_status"] == 1
    assert good.sum() >= read - 1  # the last one may be torn
    assert np.abs(table["xy_px"] - np.load(made / "truth.npy")[:read])[good].max() < 1.0
    assert json.loads((tmp_path / "a.npz.summary.json").read_text())["ended_early"]


def test_a_damaged_folder_keeps_every_time_in_its_place(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    for index in range(12):
        data = (made / "frames" / f"frame{index}.png").read_bytes()
        (folder / f"frame{index}.png").write_bytes(data)
    (folder / "frame3.png").write_bytes(b"no picture")
    (folder / "frame5.png").write_bytes(b"")
    image = cv2.imread(str(folder / "frame7.png"))
    assert image is not None
    cv2.imwrite(str(folder / "frame7.png"), image[:200, :300])
    cv2.imwrite(str(folder / "frame9.png"), np.zeros_like(image))
    (folder / "notes.txt").write_text("not a frame")
    options = ("--overlay", tmp_path / "o.avi", "--fps", "10")
    result = run("track", made / "layout.json", folder, "-o", tmp_path / "a.csv", *options)
    assert result.exit_code == 0, result.output
    assert "1 files are left out" in result.stdout
    found = rows_of(tmp_path / "a.csv")[::MARKERS]
    assert [row["frame"] for row in found] == [str(i) for i in range(11)]
    rows = {round(10 * float(row["time_s"])): row for row in found}
    assert sorted(rows) == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]
    status = {i: rows[i]["frame_status"] for i in (3, 7, 9)}
    assert status == {3: "unreadable", 7: "other size", 9: "lost"}
    assert "300 x 200 px instead of 320 x 240 px" in rows[7]["reason"] and "not an image" in rows[3]["reason"]
    others = [row for i, row in rows.items() if i not in status]
    assert all(row["frame_status"] == "tracked" and row["x_px"] and not row["reason"] for row in others)
    assert all(rows[i]["x_px"] == "" and rows[i]["status"] == "0" for i in status)
    video = cv2.VideoCapture(str(tmp_path / "o.avi"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 11


class StoppingCamera:
    """Stands for OpenCV's reader of a camera that is unplugged after some frames."""

    def __init__(self, folder: Path, frames: int, stamps_ms: list[float] | None = None) -> None:
        self.paths = [folder / f"frame{i}.png" for i in range(frames)]
        self.stamps_ms = stamps_ms or []
        self.released = False

    def isOpened(self) -> bool:
        return True

    def get(self, key: int) -> float:
        if key == cv2.CAP_PROP_POS_MSEC:
            return self.stamps_ms.pop(0) if self.stamps_ms else 0.0  # as of a driver without stamps
        return {cv2.CAP_PROP_FRAME_WIDTH: 320, cv2.CAP_PROP_FRAME_HEIGHT: 240}.get(key, -1)

    def getBackendName(self) -> str:
        return "V4L2"

    def read(self) -> tuple[bool, Any]:
        return (True, cv2.imread(str(self.paths.pop(0)))) if self.paths else (False, None)

    def release(self) -> None:
        self.released = True


def test_a_camera_that_stops(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    camera = StoppingCamera(made / "frames", 8)
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: camera)
    line = refused("track", made / "layout.json", "0", "-o", tmp_path / "a.npz", "--max-pixels", 60_000)
    assert "camera 0: the frames have 320 x 240 px; the limit is 0.06 megapixels" in line
    result = run("track", made / "layout.json", "0", "-o", tmp_path / "a.npz")
    assert result.exit_code == 1 and "the camera stopped after 8 frames" in result.stderr
    table = loaded(tmp_path / "a.npz")
    assert (table["frame_status"] == [1] * 8 + [3] * (len(table["frame"]) - 8)).all()
    assert table["time_s"][0] == 0 and (np.diff(table["time_s"]) >= 0).all()
    assert camera.released


def test_a_cameras_own_time_stamps(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time by the source's clock; a stamp that does not increase, or is long before the arrival, is ignored."""
    stamps_ms = [7e6, 7e6 + 40, 7e6 + 80, 7e6 + 80, 5.0, 7e6 + 210]
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: StoppingCamera(made / "frames", 6, stamps_ms))
    monkeypatch.setattr("time.monotonic", iter([100 + 0.05 * k for k in range(40)]).__next__)
    times = [frame.time_s for frame in open_source("0").frames() if frame.image is not None]
    np.testing.assert_allclose(times, [0, 0.04, 0.08, 0.15, 0.2, 0.21], atol=1e-6)


def test_a_camera_that_is_not_there(made: Path, tmp_path: Path) -> None:
    assert "camera 63 cannot be opened" in refused(
        "track", made / "layout.json", "63", "-o", tmp_path / "a.npz"
    )
    assert list(tmp_path.iterdir()) == []


def test_letters_of_a_damaged_video_are_not_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A name of four letters in an AVI file may be an escape sequence."""
    path = tmp_path / "a.avi"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (32, 24))
    for _ in range(3):
        video.write(np.zeros((24, 32, 3), np.uint8))
    video.release()
    good = path.read_bytes()
    for name in (b"RIFF", b"AVI ", b"LIST", b"hdrl", b"avih", b"strl", b"strh", b"movi"):
        path.write_bytes(good.replace(name, b"\x1b[2J", 1))
        with suppress(SourceError):
            list(open_source(str(path)).frames())
    assert "\x1b" not in "".join(capfd.readouterr())


def test_a_stream_is_read_by_its_address(made: Path, tmp_path: Path) -> None:
    """A video that a server sends, as a network camera does; a password is not shown or stored."""
    handler = partial(QuietHandler, directory=str(made))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://me:secret@127.0.0.1:{server.server_port}/video.avi"
        result = run("track", made / "layout.json", address, "-o", tmp_path / "a.npz")
        missing = f"http://me:secret@127.0.0.1:{server.server_port}/none.avi"
        line = refused("track", made / "layout.json", missing, "-o", tmp_path / "b.npz")
        server.shutdown()
    assert result.exit_code == 1 and f"stream http://127.0.0.1:{server.server_port}" not in result.stdout
    assert f"the stream stopped after {FRAMES} frames" in result.stderr
    assert (loaded(tmp_path / "a.npz")["frame_status"][:FRAMES] == 1).all()
    texts = [line, result.output, (tmp_path / "a.npz.summary.json").read_text()]
    assert not any("secret" in text for text in texts)
    assert f"stream {missing.replace('me:secret@', '')} cannot be opened" in line


def test_an_address_is_said_as_it_was_given(made: Path, tmp_path: Path) -> None:
    address = "rtsp://127.0.0.1:9/live"
    assert f"stream {address} cannot be opened; check the address" in refused(
        "track", made / "layout.json", address, "-o", tmp_path / "a.npz"
    )


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None: ...
