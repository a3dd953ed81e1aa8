"""Frames that the page shows in Chromium: of the browser's camera, and of ``view`` with one view and with two."""

from __future__ import annotations

import json
import tempfile
from base64 import urlsafe_b64encode
from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import av
import cv2
import numpy as np
import psutil

import cmpdesign
from benchmarks.frame.table import TEXT
from benchmarks.studio.page import browser, served
from benchmarks.studio.sensor import FPS, SIZE, write_touched_sensor

FIELDS = {"pattern": "honeycomb", "layers": 10, "pitch_mm": 1.5}
PICTURES, PITCH_PX, SETTLED_MS, RATES = 16, 20, 3000, (FPS, 2 * FPS)
# Full color in every row of pixels, as cameras send it, and in every second one, as most video files hold it.
CAMERA_CHROMA, FILE_CHROMA = "yuvj422p", "yuvj420p"
SHOWN = {
    "source": TEXT, "frames/s": ".0f", "read/s": ".1f", "shown/s": ".1f", "longest gap ms": ".0f",
    "server ms": ".1f", "browser ms": ".1f",
}  # fmt: skip
# Every animation frame of the browser: its time, and the number of the frame that stands on the page.
_COUNT = r"""() => {
    window.seen = [];
    const look = (ms) => {
        const number = /frame (\d+)/.exec(document.querySelector(".stage .note").textContent)?.[1];
        if (number && number !== window.seen.at(-1)?.[0]) window.seen.push([number, ms]);
        requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
}"""
_READ = "document.querySelector('dl.figures').innerText"


class Spent(NamedTuple):
    """Processor time so far of the server and of all processes of the browser, s."""

    server_s: float
    browser_s: float


def shown_rows(seconds: float) -> Iterator[tuple[Any, ...]]:
    """The rows of ``SHOWN``."""
    with tempfile.TemporaryDirectory(prefix="cmpdesign-shown-") as name:
        folder = Path(name)
        layout = cmpdesign.Design(**FIELDS).layout
        cmpdesign.write_layout(layout, folder / "layout.json")
        images = [
            cmpdesign.render(layout, pitch_px=PITCH_PX, press_mm=0.02 * k, noise=1.5, seed=k).image
            for k in range(PICTURES)
        ]
        there_and_back = images + images[::-1]
        state = urlsafe_b64encode(json.dumps({"fields": FIELDS}).encode()).decode().rstrip("=")
        for fps in RATES:
            _write_camera(folder / "camera.y4m", there_and_back, fps)
            with served() as address, browser(folder / "camera.y4m") as chrome:
                link = f"{address}#/touch?d={state}"
                yield _row(
                    "camera of the browser", fps, chrome, link, seconds, "Use the camera of this browser"
                )
        touched = folder / "touched"
        touched.mkdir()
        words = write_touched_sensor(touched)
        pressed = [cv2.imread(str(path)) for path in sorted((touched / "frames").glob("*.png"))]
        video = folder / "video.avi"
        for name, arguments, frames in (
            ("view, one view", [str(folder / "layout.json")], there_and_back),
            ("view, surface and force", words, pressed + pressed[::-1]),
        ):
            for fps, chroma in (*((fps, CAMERA_CHROMA) for fps in RATES), (FPS, FILE_CHROMA)):
                _write_video(video, frames, fps, seconds + 20, chroma)
                row = f"{name}, {'4:2:0' if chroma == FILE_CHROMA else '4:2:2'}"
                with (
                    served("view", arguments[0], str(video), *arguments[1:]) as address,
                    browser() as chrome,
                ):
                    yield _row(row, fps, chrome, f"{address}#/touch", seconds)


def _row(name: str, fps: int, chrome: Any, address: str, seconds: float, button: str = "") -> tuple[Any, ...]:
    page = chrome.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    if button:
        page.click(f"text={button}")
    page.wait_for_timeout(SETTLED_MS)
    page.evaluate(_COUNT)
    before = _spent()
    page.wait_for_timeout(1000 * seconds)
    after = _spent()
    shown_ms = np.array([ms for _, ms in page.evaluate("window.seen")])
    words = page.evaluate(_READ).split("\n")
    read = float(words[words.index("Source") + 1].split()[0])
    page.close()
    gaps_ms = np.diff(shown_ms)
    each_ms = [1000 * (end - start) / len(shown_ms) for start, end in zip(before, after, strict=True)]
    return name, fps, read, 1000 * len(gaps_ms) / float(gaps_ms.sum()), float(gaps_ms.max()), *each_ms


def _spent() -> Spent:
    """The processor time of the running page and browser."""
    server_s = browser_s = 0.0
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            words, times = process.cmdline(), process.cpu_times()
            if "cmpdesign" in words:
                server_s += times.user + times.system
            elif words and "chrom" in words[0]:
                browser_s += times.user + times.system
    return Spent(server_s, browser_s)


def _write_camera(path: Path, images: Sequence[Any], fps: int) -> None:
    """A file that Chromium plays as its camera, again and again."""
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{SIZE[0]} H{SIZE[1]} F{fps}:1 Ip A1:1 C420jpeg\n".encode())
        for image in images:
            file.write(b"FRAME\n" + cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420).tobytes())


def _write_video(path: Path, images: Sequence[Any], fps: int, seconds: float, chroma: str) -> None:
    """A video of JPEG frames at the smallest loss; the images are repeated."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=Fraction(fps), options={"qmin": "2", "qmax": "2"})
        stream.width, stream.height = SIZE
        stream.pix_fmt = chroma
        packets = [
            bytes(packet)
            for image in images
            for packet in stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24"))
        ]
        for k in range(int(fps * seconds)):
            packet = av.Packet(packets[k % len(packets)])
            packet.stream, packet.pts, packet.dts, packet.time_base = stream, k, k, Fraction(1, fps)
            container.mux(packet)
