"""Live in Foxglove: a client of its protocol gets the recording's bytes, and one that does not read stops nobody."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from cmpdesign.tracking.live.foxglove_server import BACKLOG_MESSAGES, FoxgloveServer
from cmpdesign.tracking.live.view import QUEUE_FRAMES, LiveView
from cmpdesign.tracking.recording.frames import FrameImage, ImagePlace, RecordedFrame
from cmpdesign.tracking.recording.options import RecordedTable, Recording
from cmpdesign.tracking.recording.points import IN_IMAGE
from cmpdesign.tracking.table import TrackTable
from extractor import Tracker, load_layout
from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, write_moving_pattern
from tests.support.tracking.foxglove_client import Received, free_port, open_client, received_while, take
from tests.support.tracking.press import FRAMES as PRESS_FRAMES
from tests.support.tracking.press import write_press

IMAGE_BYTES = 400_000


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def recorded(path: Path) -> Received:
    """The channels and messages of a recording, as the client has them."""
    found = Received()
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            found.channels[channel.topic] = {
                "encoding": channel.message_encoding,
                "schemaName": schema.name,
                "schemaEncoding": schema.encoding,
                "schema": schema.data.decode(),
            }
            found.messages.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


def shown(output: Path, *command: object) -> tuple[Received, str]:
    """The messages of a client during a command that records into ``output``, and the printed text of the command."""
    port, texts = free_port(), []

    def follow() -> None:
        options = ("--live", "foxglove", "--live-port", port, "--live-wait", 30)
        result = run(*command, "-o", output, *options)
        assert result.exit_code == 0, result.output
        assert f"live at ws://127.0.0.1:{port}" in result.stdout
        texts.append(result.stderr)

    return received_while(follow, port), texts[0]


def test_a_client_gets_the_recordings_bytes(made: Path, tmp_path: Path) -> None:
    options = ("--with-images", "--frame-id", "thumb")
    live, warnings = shown(tmp_path / "a.mcap", "track", made / "layout.json", made / "video.avi", *options)
    record = recorded(tmp_path / "a.mcap")
    assert live.messages == record.messages and not warnings
    assert {topic: len(them) for topic, them in live.messages.items()} == {
        "/thumb/markers": FRAMES,
        "/diagnostics": FRAMES,
        "/thumb/image_raw/compressed": FRAMES,
        "/thumb/camera_info": FRAMES,
    }
    for topic, channel in record.channels.items():
        assert {name: live.channels[topic][name] for name in channel} == channel
    points = live.channels["/thumb/markers"]
    schema = SimpleNamespace(
        id=1, name=points["schemaName"], encoding="ros2msg", data=points["schema"].encode()
    )
    decode = DecoderFactory().decoder_for("cdr", schema)  # type: ignore[arg-type]
    assert decode is not None
    clouds = [decode(data) for _, data in live.messages["/thumb/markers"]]
    assert len(clouds) == FRAMES and {cloud.header.frame_id for cloud in clouds} == {"thumb"}


def test_a_client_gets_a_reconstructions_bytes(tmp_path: Path) -> None:
    press = write_press(tmp_path)
    live, _ = shown(
        tmp_path / "a.mcap", "reconstruct", press / "layout.json", press / "rig.toml", 0, press / "frames"
    )
    assert live.messages == recorded(tmp_path / "a.mcap").messages
    assert {topic: len(them) for topic, them in live.messages.items()} == {
        "/tactile/markers": PRESS_FRAMES,
        "/diagnostics": PRESS_FRAMES,
    }


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * 4096 / 1e6


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc to read the memory in use")
def test_a_client_that_does_not_read_costs_neither_memory_nor_time() -> None:
    """The client's queue is bounded, the oldest frames are left out with a message, and the client gets the newest
    frame.
    """
    place = ImagePlace("tactile", ())
    server = FoxgloveServer({"tactile": False}, free_port(), [place])
    markers, received = np.zeros(331, IN_IMAGE), Received()

    def frame(number: int) -> RecordedFrame:
        image = FrameImage("tactile", number.to_bytes(IMAGE_BYTES, "little"), (640, 480), ())
        return RecordedFrame(number, number, markers, 0, "tracked", {}, (image,))

    client = open_client(int(server.address.rpartition(":")[2]))
    with client:
        while len(received.channels) < 3:
            take(client, received, 10)
        assert server.wait(10)
        before, started, count = resident_mb(), time.monotonic(), 1000
        for number in range(count):
            server.send([frame(number)])
        seconds, grown = time.monotonic() - started, resident_mb() - before
        assert server.is_behind()
        limit = BACKLOG_MESSAGES / 3 * IMAGE_BYTES / 1e6
        assert grown < 2 * limit + 20 < count * IMAGE_BYTES / 1e6 / 4 and seconds < 20
        while (
            not received.messages.get("/tactile/markers")
            or received.messages["/tactile/markers"][-1][0] < count - 1
        ):
            take(client, received, 10)
    assert len(received.messages["/tactile/markers"]) < count / 2
    server.close()


def test_only_this_machine_can_connect() -> None:
    server = FoxgloveServer({"tactile": False}, free_port())
    port = int(server.address.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), 5):
        pass
    with pytest.raises(OSError), socket.create_connection(("127.0.0.2", port), 5):
        pass
    server.close()


class Stuck:
    """A server that accepts the first frames, and no others before ``go``."""

    address = "nowhere"

    def __init__(self) -> None:
        self.go, self.frames = Event(), 0

    def wait(self, seconds: float) -> bool:
        return True

    def send(self, frames: Any) -> None:
        self.frames += len(frames)
        self.go.wait(60)

    def is_behind(self) -> bool:
        return False

    def close(self) -> None: ...


@pytest.fixture
def frame_and_table(made: Path) -> Iterator[tuple[Any, RecordedTable]]:
    tracker = Tracker(load_layout(made / "layout.json"))
    frame = tracker.track(cv2.imread(str(made / "frames" / "frame0.png")), time_s=0.0)
    yield frame, RecordedTable(TrackTable(tracker), Recording())


def test_a_stuck_server_holds_nobody_up(frame_and_table: tuple[Any, RecordedTable]) -> None:
    frame, table = frame_and_table
    server = Stuck()
    view = LiveView(server, table)
    view.add(frame)
    while not server.frames:
        time.sleep(0.001)
    started, count = time.monotonic(), 500
    for _ in range(count):
        view.add(frame)
        assert view.waiting() <= QUEUE_FRAMES
    assert time.monotonic() - started < 1
    server.go.set()
    found = view.close()
    assert found.left_out == count - QUEUE_FRAMES and found.sent == server.frames == 1 + QUEUE_FRAMES


def test_what_viewers_did_not_get_is_said(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames without time to be sent, and a server that fails: warnings, and the run is complete."""
    command = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.npz")
    options = ("--live", "foxglove", "--live-port", "0")
    monkeypatch.setattr("cmpdesign.tracking.live.view.QUEUE_FRAMES", 1)
    is_over, close = Event(), LiveView.close
    monkeypatch.setattr(FoxgloveServer, "send", lambda *_: is_over.wait(60))
    monkeypatch.setattr(LiveView, "close", lambda view: [is_over.set(), close(view)][1])
    monkeypatch.setattr(FoxgloveServer, "is_behind", lambda _: True)
    result = run(*command, *options)
    assert result.exit_code == 0 and f"of {FRAMES} frames were not shown live" in result.stderr
    assert "a live viewer read more slowly than the frames were made" in " ".join(result.stderr.split())
    monkeypatch.setattr(FoxgloveServer, "send", lambda *_: 1 / 0)
    result = run(*command, *options)
    assert result.exit_code == 0 and "the live server stopped after 0 frames (ZeroDivision" in result.stderr
    with np.load(tmp_path / "a.npz") as table:
        assert len(table["frame"]) == FRAMES


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--live-port", "9"), "--live-port and --live-wait need --live"),
        (("--live", "foxglove", "--live-port", "65536"), "--live-port 65536: expected a number from 0"),
        (("--live", "foxglove", "--live-wait", "-1"), "--live-wait -1: expected a number of seconds"),
        (("--live", "rerun", "--live-wait", "1"), "Rerun's server keeps the frames"),
    ],
)
def test_bad_options_are_one_line_and_no_file(
    options: tuple[str, ...], expected: str, made: Path, tmp_path: Path
) -> None:
    line = refused("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.npz", *options)
    assert expected in line and list(tmp_path.iterdir()) == []


def test_a_port_of_another_program_is_one_line_and_no_file(made: Path, tmp_path: Path) -> None:
    command = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.npz")
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        line = refused(*command, "--live", "foxglove", "--live-port", port)
    assert f"--live-port {port}: cannot be opened" in line and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("module", "options", "extra"),
    [
        ("foxglove", ("-o", "a.npz", "--live", "foxglove"), "live"),
        ("rerun", ("-o", "a.npz", "--live", "rerun"), "rerun"),
        ("rerun", ("-o", "a.rrd"), "rerun"),
    ],
)
def test_without_a_library_one_line_says_how_to_get_it(
    module: str, options: tuple[str, ...], extra: str, made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(made)
    before = sorted(made.rglob("*"))
    line = refused("track", "layout.json", "video.avi", *options)
    assert f"of the extra [{extra}]" in line and "pip install" in line and sorted(made.rglob("*")) == before
