"""Frames that the page shows in Chromium: of the browser's camera, and of ``view`` with one view and with two."""

from __future__ import annotations

import json
import tempfile
from base64 import urlsafe_b64encode
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import cmpdesign
from benchmarks.frame.table import TEXT
from benchmarks.studio.page import browser, served
from benchmarks.studio.sensor import FPS, SIZE, write_touched_sensor

FIELDS = {"pattern": "honeycomb", "layers": 10, "pitch_mm": 1.5}
PICTURES, PITCH_PX, SETTLED_MS, FAST = 16, 20, 3000, 2
SHOWN = {
    "source": TEXT, "frames/s": ".0f", "read/s": ".1f", "shown/s": ".1f", "longest gap ms": ".0f",
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
        _write_camera(folder / "camera.y4m", there_and_back, FPS)
        state = urlsafe_b64encode(json.dumps({"fields": FIELDS}).encode()).decode().rstrip("=")
        with served() as address, browser(folder / "camera.y4m") as chrome:
            link = f"{address}#/touch?d={state}"
            yield _row("camera of the browser", FPS, chrome, link, seconds, "Use the camera of this browser")
        one_view = [str(folder / "layout.json")]
        for fps in (FPS, FAST * FPS):
            yield _view_row("view, one view", folder, one_view, there_and_back, fps, seconds)
        touched = folder / "touched"
        touched.mkdir()
        words = write_touched_sensor(touched)
        pressed = [cv2.imread(str(path)) for path in sorted((touched / "frames").glob("*.png"))]
        yield _view_row("view, surface and force", folder, words, pressed + pressed[::-1], FPS, seconds)


def _view_row(
    name: str, folder: Path, words: Sequence[str], images: Sequence[Any], fps: int, seconds: float
) -> tuple[Any, ...]:
    """The row of ``view`` over a video."""
    path = folder / "video.avi"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), fps, SIZE)
    for k in range(int(fps * (seconds + 20))):
        video.write(images[k % len(images)])
    video.release()
    with served("view", words[0], str(path), *words[1:]) as address, browser() as chrome:
        return _row(name, fps, chrome, f"{address}#/touch", seconds)


def _row(name: str, fps: int, chrome: Any, address: str, seconds: float, button: str = "") -> tuple[Any, ...]:
    page = chrome.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    if button:
        page.click(f"text={button}")
    page.wait_for_timeout(SETTLED_MS)
    page.evaluate(_COUNT)
    page.wait_for_timeout(1000 * seconds)
    shown_ms = np.array([ms for _, ms in page.evaluate("window.seen")])
    words = page.evaluate(_READ).split("\n")
    read = float(words[words.index("Source") + 1].split()[0])
    page.close()
    gaps_ms = np.diff(shown_ms)
    return name, fps, read, 1000 * len(gaps_ms) / float(gaps_ms.sum()), float(gaps_ms.max())


def _write_camera(path: Path, images: Sequence[Any], fps: int) -> None:
    """A file that Chromium plays as its camera, again and again."""
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{SIZE[0]} H{SIZE[1]} F{fps}:1 Ip A1:1 C420jpeg\n".encode())
        for image in images:
            file.write(b"FRAME\n" + cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420).tobytes())
