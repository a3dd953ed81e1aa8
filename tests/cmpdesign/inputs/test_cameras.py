"""Cameras through OpenCV's V4L2 and the package's, with a driver that is preloaded instead of the kernel's.

The driver (tests/support/camera/v4l2_device.c) has the formats, ranges and roundings of common webcams.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cmpdesign.inputs import cameras as inputs
from cmpdesign.inputs.cameras import listing
from cmpdesign.tracking.sources import Reading, SourceError, open_source
from tests.support.command import refused
from tests.support.tracking.files import loaded, write_moving_pattern

SENT = 8
CUT = 5
PROGRAM = """
import sys
from pathlib import Path
from cmpdesign.inputs.cameras import listing
listing.SYSTEM, listing.DEVICES = Path(sys.argv[1]) / "sys", Path(sys.argv[1]) / "dev"
from cmpdesign.cli import main
for words in Path(sys.argv[1], "calls.txt").read_text().splitlines():
    sys.argv = ["cmpdesign", *words.split("|")]
    try:
        main()
    except SystemExit as end:
        print("exit", end.code, flush=True)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def plug_in(folder: Path, number: int, name: str, serial: str) -> None:
    """Files as the kernel has them of a USB camera."""
    device = folder / "sys" / f"video{number}" / "device"
    device.mkdir(parents=True)
    (device.parent / "name").write_text(f"{name}\n")
    (device / "serial").write_text(f"{serial}\n")
    links = folder / "dev" / "v4l" / "by-id"
    links.mkdir(parents=True, exist_ok=True)
    (links / f"usb-{serial}-video-index0").symlink_to(folder / "dev" / f"video{number}")


@pytest.fixture(scope="module")
def told(made: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str], list[str]]:
    """The folder of the results, and what the program printed and warned with the camera plugged in."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("needs Linux and a C compiler")
    folder = tmp_path_factory.mktemp("camera")
    plug_in(folder, 7, "Fine Camera: Fine Camera", "1A2B3C")
    (folder / "frames").mkdir()
    for k in range(SENT):
        image = cv2.imread(str(made / "frames" / f"frame{k}.png"))
        assert image is not None
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
        (folder / "frames" / f"{k}.jpg").write_bytes(data if k != CUT else data[: len(data) // 2])
    source = Path(__file__).parents[2] / "support" / "camera" / "v4l2_device.c"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", folder / "camera.so", source, "-ldl"], check=True)
    asked = "--camera-format|MJPG|--camera-size|320x240|--exposure|8|--gain|20|--focus|33"
    calls = ["cameras|--json", f"track|{made / 'layout.json'}|fine cam|-o|{folder / 'a.npz'}|{asked}"]
    (folder / "calls.txt").write_text("\n".join(calls))
    environment = {
        **os.environ,
        "LD_PRELOAD": str(folder / "camera.so"),
        "CAMERA_FRAMES": str(folder / "frames"),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, folder],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    return folder, done.stdout.splitlines(), done.stderr.splitlines()


def test_cameras_are_listed(told: tuple[Path, list[str], list[str]]) -> None:
    folder, printed, _ = told
    text = "\n".join(printed)
    (camera,) = json.loads(text[: text.index("exit 0")])["cameras"]
    assert camera["number"] == 7 and camera["name"] == "Fine Camera: Fine Camera"
    assert camera["serial"] == "1A2B3C" and camera["by_id"].endswith("usb-1A2B3C-video-index0")
    offered = [(each["format"], each["size_px"], each["fps"]) for each in camera["formats"]]
    assert offered == [
        ("YUYV", [320, 240], [30, 15]),
        ("MJPG", [320, 240], [30, 15]),
        ("MJPG", [640, 480], [30, 15]),
    ]
    ranges = {each["name"]: (each["least"], each["most"], each["unit"]) for each in camera["ranges"]}
    assert ranges["exposure"] == (1, 500, "ms") and ranges["focus"] == (0, 250, "")
    assert (folder / "a.npz").exists()


def test_settings_are_asked_compared_and_recorded(told: tuple[Path, list[str], list[str]]) -> None:
    folder, _, warnings = told
    assert sum("--focus 33 was asked for, the camera uses 30" in line for line in warnings) == 1
    assert not any("--exposure 8 was" in line or "--gain" in line for line in warnings)
    (hint,) = [line for line in warnings if "still chooses for itself" in line]
    assert "--white-balance" in hint and "--exposure" not in hint
    (used,) = json.loads((folder / "a.npz.summary.json").read_text())["cameras"]
    assert used["camera_size"] == [320, 240] and used["camera_format"] == "MJPG"
    assert (used["exposure_ms"], used["gain"], used["focus"]) == (8, 20, 30)
    assert used["automatic"] == ["white_balance_k"] and used["asked"]["focus"] == 33


def test_frames_of_a_camera(told: tuple[Path, list[str], list[str]], made: Path) -> None:
    """A frame that is cut off on the cable has no image; the others are those that were sent, at rising times."""
    folder, printed, warnings = told
    table = loaded(folder / "a.npz")
    is_cut = np.array(["cut off" in reason for reason in table["reason"]])
    (cut,) = np.flatnonzero(is_cut)
    assert cut >= 2 and table["frame_status"][cut] == 3
    truth = np.load(made / "truth.npy")
    read = np.flatnonzero(table["frame_status"] == 1)
    assert len(read) == cut + SENT - 1 - CUT
    for index in read:
        assert np.nanmax(np.abs(table["xy_px"][index] - truth[index + CUT - cut])) < 0.5
    steps_s = np.diff(table["time_s"][: read.max() + 1])
    assert steps_s.min() > 0.02
    assert any("the camera's stamps" in line for line in printed) and "exit 1" in printed
    assert any("the camera stopped" in line for line in warnings)


def test_two_cameras_of_one_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, serial in ((1, "AAA"), (3, "BBB")):
        plug_in(tmp_path, number, "HD Camera", serial)
    monkeypatch.setattr(listing, "SYSTEM", tmp_path / "sys")
    monkeypatch.setattr(listing, "DEVICES", tmp_path / "dev")
    assert [camera.number for camera in inputs.list_cameras()] == [1, 3]
    found = inputs.find_camera("BBB")
    assert found is not None and found.number == 3 and "cannot be opened" in found.offer.problem
    assert inputs.find_camera("another") is None
    with pytest.raises(SourceError, match=r"2 cameras have this name: .*AAA.*BBB"):
        open_source("hd cam")


class OtherCamera:
    """Stands for OpenCV's reader on a system without V4L2."""

    def isOpened(self) -> bool:
        return True

    def getBackendName(self) -> str:
        return "MSMF"

    def set(self, key: int, value: float) -> bool:
        return key != cv2.CAP_PROP_FRAME_WIDTH

    def get(self, key: int) -> float:
        return {cv2.CAP_PROP_FRAME_WIDTH: 640.0, cv2.CAP_PROP_FRAME_HEIGHT: 480.0}.get(key, -1.0)


def test_a_camera_of_another_system(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sizes are asked for and compared; controls whose unit is unknown are refused."""
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: OtherCamera())
    source = open_source("0", Reading(camera=inputs.CameraSettings(camera_size=(1280, 720))))
    assert source.notes == ["camera 0: camera_size 1280x720 was asked for, the camera uses 640x480"]
    with pytest.raises(SourceError, match="exposure_ms can be set on Linux"):
        open_source("0", Reading(camera=inputs.CameraSettings(exposure_ms=8)))


def test_a_file_is_no_camera(made: Path, tmp_path: Path) -> None:
    call: tuple[Any, ...] = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.npz")
    assert "--exposure is for cameras" in refused(*call, "--exposure", 8)
    assert "expected WIDTHxHEIGHT" in refused(*call, "--camera-size", "big")
    assert "expected four letters" in refused(*call, "--camera-format", "MJPEG")


@pytest.mark.skipif(not hasattr(os, "mknod"), reason="needs device files")
def test_a_camera_by_its_file(tmp_path: Path) -> None:
    try:
        os.mknod(tmp_path / "video5", 0o020600, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("needs the right to make device files")
    (tmp_path / "usb-X-index0").symlink_to(tmp_path / "video5")
    assert inputs.camera_of_path(str(tmp_path / "usb-X-index0")) == 5
    assert inputs.camera_of_path(str(tmp_path)) is None
