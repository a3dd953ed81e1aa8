"""From the middle of the exposure to the result of a running sensor, and how many cores two sensors use.

``cmpdesign.open_sensor`` reads a camera with known exposure times in the place of OpenCV's: 640 x 480 px, 331 markers,
8 pictures of a press in turn, 4 ms of exposure. "p50", "p99", "worst": ms from the middle of the exposure to the
result, of all results after the first second. "dropped": percentage of the camera's frames without a result;
"unreported": frames without a result that no result counts, by the exposure times. For the figures of ten minutes give
--seconds 600.

Then one sensor and two sensors on cameras of 400 frames a second, for a third of the time each: results a second, and
the processor's time over the time by the clock.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import cmpdesign
from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.table import Table
from benchmarks.latency.timed_camera import TimedCamera, in_the_place_of_opencv, write_sensor
from cmpdesign.scene import Press, render, standard_layout, standard_scene

RATES_HZ, FAST_HZ, SECONDS, QUICK_SECONDS, SETTLED_S = (60.0, 120.0), 400.0, 30.0, 2.0, 1.0
SIZE, FOCAL_PX, LAYERS, PICTURES = (640, 480), 900.0, 10, 8
LATENCY = {
    "frames/s": ".0f", "results": "d", "p50 ms": ".1f", "p99 ms": ".1f", "worst ms": ".1f", "dropped %": ".1f",
    "unreported": "d",
}  # fmt: skip
THROUGHPUT = {"sensors": "d", "results/s": ".0f", "cores": ".2f"}


def _write_layout(folder: Path) -> list[Any]:
    layout = standard_layout("honeycomb", LAYERS)
    cmpdesign.write_layout(layout, folder / "layout.json")
    scene = standard_scene(layout)
    presses = [Press(4.0, 0.05 * k) for k in range(PICTURES)]
    return [render(replace(scene, surface=one, seed=k), size=SIZE).image for k, one in enumerate(presses)]


def _opened(folder: Path, cameras: list[TimedCamera]) -> Any:
    cv2.VideoCapture = in_the_place_of_opencv(dict(enumerate(cameras)))  # type: ignore[misc,assignment]
    paths = [folder / f"sensor{number}.toml" for number in range(len(cameras))]
    for number, (path, camera) in enumerate(zip(paths, cameras, strict=True)):
        write_sensor(path, number, camera.fps, FOCAL_PX, SIZE)
    return cmpdesign.open_sensor(*paths)


def latency_row(folder: Path, images: list[Any], rate_hz: float, seconds: float) -> tuple[Any, ...]:
    """A row of ``LATENCY``."""
    camera = TimedCamera(images, rate_hz)
    frames = []
    with _opened(folder, [camera]) as sensors:
        (sensor,) = sensors
        frame, end_s = sensor.wait(), time.monotonic() + SETTLED_S + seconds
        while time.monotonic() < end_s:
            frame = sensor.wait(after=frame.index, timeout_s=5.0)
            frames.append((frame.index, frame.taken_s, frame.latency_ms))
    index, taken_s, latency_ms = (np.array(column) for column in zip(*frames, strict=True))
    settled = taken_s > taken_s[0] + SETTLED_S
    index, taken_s, latency_ms = index[settled], taken_s[settled], latency_ms[settled]
    by_exposure = np.rint((taken_s + 0.5e-3 * camera.exposure_ms - camera.began_s) * rate_hz)
    unreported = int(np.abs(np.diff(by_exposure) - np.diff(index)).sum())
    dropped = 100 * (1 - (len(index) - 1) / float(index[-1] - index[0]))
    p50, p99 = np.percentile(latency_ms, [50, 99])
    return rate_hz, len(index), float(p50), float(p99), float(latency_ms.max()), dropped, unreported


def throughput_row(folder: Path, images: list[Any], count: int, seconds: float) -> tuple[int, float, float]:
    """A row of ``THROUGHPUT``."""
    with _opened(folder, [TimedCamera(images, FAST_HZ) for _ in range(count)]) as sensors:
        sensors.wait()
        time.sleep(SETTLED_S)
        began_s, cpu_s, before = time.monotonic(), time.process_time(), [one.count for one in sensors]
        time.sleep(seconds)
        spent_s, cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s
        done = sum(one.count for one in sensors) - sum(before)
    return count, done / spent_s, cpu_s / spent_s


def measure(seconds: float = SECONDS, quick: bool = False) -> Shown:
    """Latency at two rates, then the results of one and of two sensors.

    Args:
        seconds: of each rate.
        quick: few seconds.
    """
    seconds = QUICK_SECONDS if quick else seconds
    original = cv2.VideoCapture
    try:
        with tempfile.TemporaryDirectory(prefix="cmpdesign-latency-") as name:
            folder = Path(name)
            images = _write_layout(folder)
            latencies = [latency_row(folder, images, rate_hz, seconds) for rate_hz in RATES_HZ]
            yield Table("from the middle of the exposure to the result", LATENCY, latencies)
            alone, both = (throughput_row(folder, images, count, seconds / 3) for count in (1, 2))
            yield Table("sensors on cameras that are too fast", THROUGHPUT, [alone, both])
            yield (
                f"two sensors give {both[1] / alone[1]:.2f} times the results of one, and use "
                f"{both[2] - alone[2]:.0%} of a second core"
            )
    finally:
        cv2.VideoCapture = original  # type: ignore[misc]
    return Found({"seconds": seconds}, failed=any(row[-1] for row in latencies))


main = Experiment("latency", measure)
main.run_as(__name__)
