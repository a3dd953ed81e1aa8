"""Running sensors: cameras with known exposure times stand in the place of OpenCV's, and fail as real ones do."""

from __future__ import annotations

import logging
import pickle
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

import cmpdesign
from benchmarks.latency.timed_camera import Fault, TimedCamera, in_the_place_of_opencv, write_sensor
from cmpdesign.errors import CmpDesignError
from cmpdesign.runtime.events import EventKind
from cmpdesign.runtime.opening import Sensors
from cmpdesign.runtime.pairing import nearest_places
from cmpdesign.runtime.plan import plan_of
from cmpdesign.runtime.publish.serving import SensorServer
from cmpdesign.runtime.sensor import LateError
from cmpdesign.runtime.zero import TouchedError
from cmpdesign.scene import Press
from cmpdesign.sensor.sensor_file import load_sensor_file
from cmpdesign.sensor.tables import SensorError
from extractor import FrameStatus
from tests.support.layouts import small_text
from tests.support.tracking.foxglove_client import Received, open_client, take
from tests.support.tracking.messages import read_messages
from tests.support.tracking.press import write_press
from tests.support.tracking.scenes import LAYERS, errors, moving, shot

STORE = get_typestore(Stores.ROS2_HUMBLE)
FPS = 20.0
Plug = Callable[..., dict[int, TimedCamera]]


@pytest.fixture(scope="module")
def shots() -> list[Any]:
    return list(moving(6))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    for number, name in enumerate(("thumb", "index")):
        write_sensor(tmp_path / f"{name}.toml", number, FPS)
    return tmp_path


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Plug:
    def in_place(*cameras: TimedCamera) -> dict[int, TimedCamera]:
        numbered = dict(enumerate(cameras))
        monkeypatch.setattr(cv2, "VideoCapture", in_the_place_of_opencv(numbered))
        return numbered

    return in_place


def opened(*paths: Path) -> Any:
    return cmpdesign.open_sensor(*paths)


def after(sensor: Any, kind: EventKind, within_s: float = 3.0) -> Any:
    """The first event of a kind, waited for."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        if found := [one for one in sensor.events if one.kind is kind]:
            return found[0]
        time.sleep(0.005)
    raise AssertionError(f"no {kind} in {sensor.events}")


def test_the_newest_frame_with_its_time(folder: Path, plug: Plug, shots: list[Any]) -> None:
    (camera,) = plug(TimedCamera([one.image for one in shots], FPS)).values()
    with opened(folder / "thumb.toml") as sensors:
        frame = sensors.thumb.wait()
        for _ in range(5):
            last, frame = frame, sensors.thumb.wait(after=frame.index, timeout_s=1.0)
            assert frame.index > last.index
            number = (frame.taken_s + 0.002 - camera.began_s) * FPS  # 4 ms of exposure, stamped at its end
            assert number == pytest.approx(round(number), abs=1e-3)
            assert errors(frame.markers.xy_px, shots[round(number) % len(shots)]).max() < 0.2
        assert frame.latency_ms < frame.age_ms < 1e3 and abs(frame.taken_unix_s - time.time()) < 0.5
        assert frame.shape is None and frame.contact is None and frame.events == ()
        copy = pickle.loads(pickle.dumps(frame))
        assert np.array_equal(copy.markers.xy_px, frame.markers.xy_px, equal_nan=True)
        for one, other in pairwise(sensors.thumb.results):
            assert other.index - one.index == other.dropped + 1
        health = sensors.thumb.health
        assert 0 < health.frames_per_s < 1.5 * FPS and health.share_read > 0.9
        assert health.latency_ms[0] <= health.latency_ms[2] and health.qualities[0].blur_px > 0.5
    with pytest.raises(LateError, match="thumb: no result after"):
        sensors.thumb.wait(after=frame.index + 1000, timeout_s=0.01)
    for timeout_s in (float("nan"), float("inf"), None):
        with pytest.raises(CmpDesignError, match=f"timeout_s is {timeout_s}; give the longest wait"):
            sensors.thumb.wait(after=10**6, timeout_s=timeout_s)


def test_dropped_frames_are_counted(folder: Path, plug: Plug, shots: list[Any]) -> None:
    """A camera that is much faster than the reader: every frame has a result, or is counted."""
    fast = 1000.0
    text = (folder / "thumb.toml").read_text().replace("fps = 20.0", f"fps = {fast}")
    (folder / "thumb.toml").write_text(text)
    plug(TimedCamera([one.image for one in shots], fast))
    with opened(folder / "thumb.toml") as sensors:
        end_s = time.monotonic() + 10
        while sum(one.dropped for one in sensors.thumb.results) <= 10 and time.monotonic() < end_s:
            time.sleep(0.02)
    frames = sensors.thumb.results
    assert sum(one.dropped for one in frames) > 10
    for before, one in pairwise(frames):
        missing = (one.taken_s - before.taken_s) * fast - 1
        # the first steps between frames are not known yet
        assert one.dropped == pytest.approx(missing, abs=0.1) or one.index < 20


@pytest.mark.parametrize("kind", ["stall", "unplugged", "small"])
def test_a_gap_is_reported_within_two_frames_and_ends(
    kind: str, folder: Path, plug: Plug, shots: list[Any], caplog: pytest.LogCaptureFixture
) -> None:
    fps, begin_s = 10.0, 0.75  # slow, so that two frame times are long for this machine
    camera = TimedCamera([one.image for one in shots], fps, [Fault(kind, begin_s, 1.3)])
    plug(camera)
    (folder / "thumb.toml").write_text(
        (folder / "thumb.toml").read_text().replace("fps = 20.0", "fps = 10.0")
    )
    caplog.set_level(logging.INFO, "cmpdesign.runtime")
    with opened(folder / "thumb.toml") as sensors:
        first = after(sensors.thumb, EventKind.SILENT if kind == "stall" else EventKind.STOPPED)
        noticed_s = first.unix_s - time.time() + time.monotonic() - camera.began_s
        assert noticed_s - int(begin_s * fps) / fps < 2 / fps + 0.15  # for the machine
        with pytest.raises(LateError, match=r"max_age_ms is 100 \(camera 0: "):
            while time.monotonic() - camera.began_s < 1.2:
                sensors.thumb.latest()
        resumed = after(sensors.thumb, EventKind.RESUMED)
        assert 500 < resumed.gap_ms < 2000
        frame = sensors.thumb.wait(after=sensors.thumb.results[-1].index, timeout_s=1.0)
        assert frame.status == FrameStatus.TRACKED and frame.age_ms < 500
        told = [event.kind for one in sensors.thumb.results for event in one.events]
        assert EventKind.RESUMED in told
    assert (camera.opened > 1) == (kind != "stall")
    assert "frames again after" in caplog.text
    if kind == "small":
        assert "its frames have 160 x 120 px instead of 320 x 240" in str(first)


def test_nothing_hangs_on_close(folder: Path, plug: Plug, shots: list[Any]) -> None:
    """Also while the driver keeps a read, and while the camera is away."""
    before = threading.active_count()
    for faults in ((), (Fault("stall", 0.2, 2.0),), (Fault("unplugged", 0.2, 99.0),)):
        plug(TimedCamera([one.image for one in shots], FPS, faults))
        with opened(folder / "thumb.toml") as sensors:
            time.sleep(0.35)
            began_s = time.monotonic()
        assert time.monotonic() - began_s < 1.0
        with pytest.raises(LateError):
            sensors.thumb.wait(after=10**6)
    end_s = time.monotonic() + 3
    while threading.active_count() > before and time.monotonic() < end_s:
        time.sleep(0.02)
    assert threading.active_count() == before


def test_two_sensors_are_paired_by_time(folder: Path, plug: Plug, shots: list[Any]) -> None:
    images = [one.image for one in shots]
    began_s = time.monotonic()
    plug(TimedCamera(images, FPS, began_s=began_s), TimedCamera(images, FPS, began_s=began_s + 0.01))
    with opened(folder / "thumb.toml", folder / "index.toml") as sensors:
        assert [one.name for one in sensors] == ["thumb", "index"]
        frames = sensors.wait()
        for _ in range(4):
            frames = sensors.wait(frames, timeout_s=1.0)
            offset_ms = 1e3 * (frames.index.taken_s - frames.thumb.taken_s)
            assert frames.offsets_ms == {"thumb": 0.0, "index": pytest.approx(offset_ms)}
            grid = (offset_ms - 10) / 50  # of the exposures; on a busy machine frames are dropped
            assert abs(grid - round(grid)) < 1e-3
    copy = pickle.loads(pickle.dumps(frames))
    assert copy.index.taken_s == frames.index.taken_s and copy.offsets_ms == frames.offsets_ms
    assert nearest_places([[0.0, 0.05, 0.1], [0.01, 0.06]]) == [1, 1]
    assert nearest_places([[0.0], []]) is None


def test_results_that_are_waited_for_are_newer_of_every_sensor() -> None:
    """A sensor that is behind, at 52 ms, must not take the other one back to its former result."""
    thumb, index = Played("thumb", [0, 52, 104], 2), Played("index", [4, 104], 1)
    sensors: Any = Sensors([thumb, index])
    before = sensors.wait()
    assert [one.taken_s for one in before] == [0, 4]
    index.shown = 2
    assert [one.taken_s for one in sensors.wait(before)] == [104, 104]


class Played:
    """A sensor with the results of a list of times; a wait shows the next one."""

    def __init__(self, name: str, times: list[int], shown: int) -> None:
        self.name, self.shown = name, shown
        self._all = [SimpleNamespace(name=name, index=k, taken_s=time_s) for k, time_s in enumerate(times)]

    @property
    def results(self) -> list[Any]:
        return self._all[: self.shown]

    def wait(self, after: int, timeout_s: float) -> None:
        if self.results[-1].index <= after:
            self.shown += 1


def test_zero_takes_the_mean_at_rest_and_refuses_a_touched_pattern(folder: Path, plug: Plug) -> None:
    noisy = [shot(seed=seed).image for seed in range(4)]
    pressed = [shot(surface=Press(4.0, 0.25), seed=seed).image for seed in range(4)]
    shown = noisy
    plug(TimedCamera(lambda number: shown[number % len(shown)], 60.0))
    with opened(folder / "thumb.toml") as sensors:
        sensors.thumb.wait()
        first = sensors.thumb.results[0]
        assert not np.nan_to_num(first.tracked.displacement_px).any()  # the first frame is at rest
        sensors.zero()
        frame = sensors.thumb.wait(after=sensors.thumb.results[-1].index + 1)
        moved = frame.tracked.displacement_px
        truth = shot().truth.marker_xy_px
        rest = frame.markers.xy_px - moved
        one, mean = (float(np.sqrt(np.nanmean((xy - truth) ** 2))) for xy in (frame.markers.xy_px, rest))
        assert mean < one and np.nanmax(np.abs(moved)) < 0.2
        assert sensors.thumb.health.rest_error_px < 0.05
        shown = pressed
        time.sleep(0.1)
        with pytest.raises(TouchedError, match="something touches the pattern"):
            sensors.zero()
        assert sensors.thumb.health.rest_error_px > 0.3
        sensors.zero(check=False)
        assert np.nanmax(np.abs(sensors.thumb.results[-1].tracked.displacement_px)) < 0.2  # at once
        shown = [one.image for one in moving(6, speed=8)]
        time.sleep(0.1)
        with pytest.raises(TouchedError, match="the markers move by"):
            sensors.zero()


def test_health_says_what_has_changed_since_the_rest(folder: Path, plug: Plug) -> None:
    """A scratched marker is learnt by ``zero``; dim or tinted light, a blur and a drift are told with their figures.

    A recording has the new advice as events.
    """
    clean = shot().image
    x, y = np.rint(shot().truth.marker_xy_px[40]).astype(int)
    scratched = clean.copy()
    cv2.circle(scratched, (int(x), int(y)), 10, (150, 150, 150), -1)
    shown = scratched
    plug(TimedCamera(lambda number: shown, FPS))
    with opened(folder / "thumb.toml") as sensors:

        def health(image: Any, frames: int = 12) -> Any:  # of 16, two of which may be of the image before
            nonlocal shown
            shown = image
            count = sensors.thumb.count
            while sensors.thumb.count < count + frames:
                sensors.thumb.wait(after=sensors.thumb.results[-1].index)
            found = sensors.thumb.health
            advice = [one for one in found.advice if "frames have no result" not in one]  # a busy machine
            return replace(found, advice=tuple(advice))

        sensors.zero(check=False)
        sensors.record(folder / "run.mcap")
        good = health(scratched)
        assert good.share_read == 1.0 and good.left_out == 3 and good.advice == ()
        assert good.light == pytest.approx(1, abs=0.01) and good.drift_px < 0.02
        dim = health((0.5 * scratched).astype(np.uint8), 24)
        assert dim.light == pytest.approx(0.5, abs=0.02) and max(dim.tint) < 1.05
        assert any("has 50% of its brightness" in one or "has 49%" in one for one in dim.advice)
        tinted = health((scratched * (1.0, 0.8, 0.6)).astype(np.uint8))
        assert any("blue is 1.2" in one or "blue is 1.3" in one for one in tinted.advice)
        blurred = health(cv2.GaussianBlur(scratched, (0, 0), 1.6))
        expected_px = np.hypot(good.qualities[0].blur_px, 1.6)
        assert blurred.qualities[0].blur_px == pytest.approx(expected_px, abs=0.15)
        assert any(one.startswith("refocus: the blur is") for one in blurred.advice)
        moved = health(np.roll(scratched, 2, axis=1))
        assert moved.drift_px == pytest.approx(2 / np.sqrt(2), abs=0.05)
        assert any("zero the sensor" in one for one in moved.advice)
        sensors.zero()
        assert health(np.roll(scratched, 2, axis=1)).advice == ()
        bare = health(np.roll(clean, 2, axis=1))
        assert bare.left_out == good.left_out and bare.share_read == 1.0
    told = [text for text in told_events(folder / "run.mcap") if "of its brightness at rest" in text]
    assert len(told) == 1 and "check the light: the picture has" in told[0]
    assert EventKind.HEALTH in {one.kind for one in sensors.thumb.events}


def test_a_check_by_the_own_camera(folder: Path, plug: Plug) -> None:
    """The camera's answer, light, focus, share read, residuals, force scale and ages; a pad that has moved is named."""
    path, shown, elastomer = (
        folder / "thumb.toml",
        [shot(seed=seed).image for seed in range(4)],
        "[elastomer]\n",
    )
    elastomer += "thickness_mm = 4.0\nyoung_mpa = 0.3\nyoung_sigma_mpa = 0.02\n"
    path.write_text(path.read_text() + elastomer + "[limits]\nmin_share_read = 0.99\n")
    cv2.imwrite(str(folder / "rest.png"), shown[0])
    cmpdesign.calibrate_rig(folder / "layout.json", path, folder / "rest.png", folder / "made.toml")
    aged = re.sub(r"date = .*", "date = 2020-01-01", (folder / "made.toml").read_text())
    (folder / "made.toml").write_text(aged)
    plug(TimedCamera(lambda number: shown[number % len(shown)], FPS))
    found = cmpdesign.calibrate_check(folder / "made.toml")
    assert found.holds and 0.1 < found.misfit < 1.5 and found.causes
    camera, view, force = found.cameras["camera 0"], found.views["camera"], found.force
    assert camera.settings["exposure_ms"] == 4.0 and camera.settings["camera_size"] == (320, 240)
    assert view.share_read == 1.0 and view.hints == () and 0.8 < view.blur_px < 1.5
    assert view.evenness > 0.9 and view.clipping == 0.0 and view.contrast > 40
    assert force is not None and (force.young_mpa, force.young_sigma_mpa, force.gel) == (0.3, 0.02, None)
    assert found.ages_days == {"rig": (date.today() - date(2020, 1, 1)).days}
    x, y = np.rint(shot().truth.marker_xy_px[40]).astype(int)
    shown = [np.roll(image, 2, axis=1) for image in shown]
    for image in shown:
        cv2.circle(image, (int(x), int(y)), 10, (150, 150, 150), -1)
    moved = cmpdesign.calibrate_check(folder / "made.toml")
    assert not moved.holds and "the pad has moved against the camera" in [
        c.cause for c in moved.causes if c.likely
    ]
    assert any("clean the window" in hint for hint in moved.views["camera"].hints)


def told_events(path: Path) -> list[str]:
    """The events in the diagnostics of a recording, in the order of the results."""
    return [
        pair.value
        for one in read_messages(path)["/diagnostics"]
        for pair in one.decoded_message.status[0].values
        if pair.key == "events"
    ]


def test_a_recording_of_running_sensors_has_their_gaps(folder: Path, plug: Plug, shots: list[Any]) -> None:
    """Read by the library of the format: every result is there, and the gap is told in the diagnostics."""
    images = [one.image for one in shots]
    plug(TimedCamera(images, FPS, [Fault("stall", 0.5, 0.9)]), TimedCamera(images, FPS))
    path = folder / "run.mcap"
    with opened(folder / "thumb.toml", folder / "index.toml") as sensors:
        with pytest.raises(CmpDesignError, match=r"ends in \.mcap"):
            sensors.record(folder / "run.npz")
        sensors.wait()
        recording = sensors.record(path)
        after(sensors.thumb, EventKind.RESUMED)
        sensors.thumb.wait(after=sensors.thumb.results[-1].index + 1)
        assert not path.exists()
    messages = read_messages(path)
    counts = [len(messages[f"/{name}/markers"]) for name in ("thumb", "index")]
    assert sum(counts) == recording.frames == len(messages["/diagnostics"]) and min(counts) > 0
    assert recording.missed == 0
    told = told_events(path)
    assert any("frames again after" in text for text in told) and "" in told
    recording.close()


def test_a_surface_of_recorded_views(tmp_path: Path) -> None:
    """A folder is played at its rate; frames that come while the views are placed are dropped, and counted."""
    write_press(tmp_path)
    camera = 'layout = "layout.json"\ncamera.source = "frames"\n'
    (tmp_path / "hand.toml").write_text(camera + (tmp_path / "rig.toml").read_text())
    with opened(tmp_path / "hand.toml") as sensors:
        ended = after(sensors.hand, EventKind.ENDED)
        last = sensors.hand.wait(after=2)
        with pytest.raises(LateError, match="the recorded frames are over"):
            time.sleep(0.15)
            sensors.hand.latest()
    assert "frames" in str(ended) and [one.kind for one in sensors.hand.events] == [EventKind.ENDED]
    assert last.index == 3 and sum(1 + one.dropped for one in sensors.hand.results) == 4
    truth = np.load(tmp_path / "truth.npy")[3, : len(last.shape.xyz_mm)]
    assert np.sqrt(np.nanmean((last.shape.xyz_mm - truth) ** 2)) < 0.02 and len(last.markers) == 2
    image = cv2.imread(str(min((tmp_path / "frames").glob("*.png"))))
    alone = plan_of(load_sensor_file(tmp_path / "hand.toml"), ["markers"]).first_tracker(image)
    assert alone is not None and [one.markers.found for one in alone.track(image).views] == [True, True]


def test_one_view_by_a_mirror(folder: Path, shots: list[Any]) -> None:
    path = folder / "thumb.toml"
    path.write_text(path.read_text().replace('name = "camera"', 'name = "camera"\nmirrored = true'))
    image = np.ascontiguousarray(shots[0].image[:, ::-1])
    tracker = plan_of(load_sensor_file(path), None).first_tracker(image)
    assert tracker is not None and tracker.track(image).status == FrameStatus.TRACKED


def test_results_are_served(folder: Path, plug: Plug, shots: list[Any]) -> None:
    """Two sensors by one server; a client of another library reads the markers of both."""
    plug(TimedCamera([one.image for one in shots], FPS), TimedCamera([one.image for one in shots], FPS))
    with opened(folder / "thumb.toml", folder / "index.toml") as sensors:
        sensors.wait()
        server, received = SensorServer(sensors, 0), Received()
        topics = ("/thumb/markers", "/index/markers", "/diagnostics")
        try:
            with open_client(int(server.address.rpartition(":")[2])) as client:
                while not set(topics) <= set(received.messages):
                    take(client, received, 10.0)
        finally:
            server.close()
    for topic in topics[:2]:
        (_, data), *_ = received.messages[topic]
        cloud = STORE.deserialize_cdr(data, "sensor_msgs/msg/PointCloud2")
        assert cloud.width == 91 and topic == f"/{cloud.header.frame_id}/markers"
    values = {
        pair.key
        for _, data in received.messages["/diagnostics"]
        for pair in STORE.deserialize_cdr(data, "diagnostic_msgs/msg/DiagnosticArray").status[0].values
    }
    assert {"latency_ms", "dropped", "events"} <= values


@pytest.mark.slow
def test_a_program_in_cpp_reads_the_same_bytes(folder: Path, plug: Plug, shots: list[Any]) -> None:
    """The example is compiled; the markers that it prints are those that the other client receives."""
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("no compiler of C++")
    source = Path(__file__).parents[3] / "examples" / "subscriber.cpp"
    warnings = ("-std=c++20", "-Wall", "-Wextra", "-Werror")
    subprocess.run([compiler, *warnings, "-o", folder / "subscriber", source], check=True)
    plug(TimedCamera([one.image for one in shots], FPS), TimedCamera([one.image for one in shots], FPS))
    with opened(folder / "thumb.toml", folder / "index.toml") as sensors:
        sensors.wait()
        server, received = SensorServer(sensors, 0), Received()
        port = server.address.rpartition(":")[2]
        words = [folder / "subscriber", port, "/index/markers"]
        with open_client(int(port)) as client:
            process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
            while len(received.messages.get("/index/markers", ())) < 3 * FPS:
                take(client, received, 10.0)
        server.close()
        printed = process.communicate(timeout=10)[0].splitlines()
    clouds = [
        STORE.deserialize_cdr(data, "sensor_msgs/msg/PointCloud2")
        for _, data in received.messages["/index/markers"]
    ]
    seen = [
        f"{one.width} markers of {one.point_step} bytes, marker 0 at "
        + " ".join(f"{value:.3f}" for value in one.data[:12].view(np.float32))
        for one in clouds
    ]
    assert len(printed) > FPS and set(printed) & set(seen) and len(set(printed) - set(seen)) <= 3


WRONG = {
    ("thumb.toml", "thumb.toml"): "name 'thumb' is used by this file",
    ("thumb.toml", "other.toml"): "camera '0' is used by",
    ("none.toml",): r"\[camera\] names no source",
    ("two.toml",): "names 2 cameras for 1",
    (
        "old.toml",
    ): r"old.toml: \[calibration.rig\] was made with the layout 123456789abc, .* repeat cmpdesign calibrate rig",
}


@pytest.mark.parametrize("names", WRONG, ids=lambda names: names[-1])
def test_files_that_cannot_be_used(names: tuple[str, ...], folder: Path) -> None:
    write_sensor(folder / "other.toml", 0, FPS)
    write_sensor(folder / "none.toml", "", FPS)
    write_sensor(folder / "two.toml", "0,1", FPS)
    write_sensor(folder / "old.toml", 0, FPS)
    with (folder / "old.toml").open("a", encoding="utf-8") as file:
        file.write('[calibration.rig]\nlayout_digest = "123456789abcdef"\n')
    with pytest.raises(SensorError, match=WRONG[names]):
        cmpdesign.open_sensor(*(folder / name for name in names))
    with pytest.raises(SensorError, match="shape needs two or more"):
        cmpdesign.open_sensor(folder / "thumb.toml", outputs=["shape"])
    with pytest.raises(SensorError, match=r"no output 'shpe' \(did you mean shape"):
        cmpdesign.open_sensor(folder / "thumb.toml", outputs=["shpe"])
