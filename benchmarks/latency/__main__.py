"""From the middle of the exposure to the result of running sensors, and how many cores two sensors use.

``cmpdesign.open_sensor`` reads cameras with known exposure times in the place of OpenCV's: 640 x 480 px, 331 markers,
8 pictures of a press in turn, 4 ms of exposure. "p50", "p99", "worst": ms from the middle of the exposure, as the
camera knows it, to the result, of all results after the first second. "dropped": percentage of the camera's frames
that were replaced by a newer one before the reader was free; "unreported": frames without a result that no result
counts, by the exposure times. For the figures of ten minutes give --seconds 600: 21 minutes in all.

Then, for 20 s each or less: two sensors on cameras of 60 frames a second, and one sensor and two on cameras of 400
frames a second: results a second, and the processor's time over the time by the clock.
"""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

import cmpdesign
from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.table import Table
from benchmarks.latency.timed_camera import TimedCamera, in_the_place_of_opencv, write_sensor
from cmpdesign.scene import Press, render, standard_layout, standard_scene

RATES_HZ, FAST_HZ, SECONDS, SETTLED_S = (60.0, 120.0), 400.0, 30.0, 1.0
QUICK_SECONDS, PAIR_SECONDS = 2.0, 20.0  # a share of a core is steady after seconds
SIZE, FOCAL_PX, LAYERS, PICTURES = (640, 480), 900.0, 10, 8
LATENCY = {
    "sensors": "d", "frames/s": ".0f", "results": "d", "p50 ms": ".1f", "p99 ms": ".1f", "worst ms": ".1f",
    "dropped %": ".1f", "unreported": "d",
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


def latency_row(
    folder: Path, images: list[Any], count: int, rate_hz: float, seconds: float
) -> tuple[Any, ...]:
    """A row of ``LATENCY``: of all sensors together."""
    cameras = [TimedCamera(images, rate_hz) for _ in range(count)]
    with _opened(folder, cameras) as sensors, ThreadPoolExecutor(count) as threads:
        found = list(threads.map(partial(_results, seconds=seconds), sensors, cameras))
    latency_ms = np.concatenate([one.latency_ms for one in found])
    dropped = 100 * sum(one.dropped for one in found) / sum(one.frames for one in found)
    p50, p99 = np.percentile(latency_ms, [50, 99])
    unreported = sum(one.unreported for one in found)
    return (
        count,
        rate_hz,
        len(latency_ms),
        float(p50),
        float(p99),
        float(latency_ms.max()),
        dropped,
        unreported,
    )


class Results(NamedTuple):
    """The settled results of a sensor.

    Attributes:
        latency_ms: of each result, from the middle of the camera's own exposure.
        frames: of the camera from the first result to the last.
        dropped: of these, as the results tell.
        unreported: of these, without a result that tells of them.
    """

    latency_ms: NDArray[np.float64]
    frames: int
    dropped: int
    unreported: int


def _results(sensor: Any, camera: TimedCamera, seconds: float) -> Results:
    rows, end_s = [], time.monotonic() + SETTLED_S + seconds
    frame = sensor.wait()
    while time.monotonic() < end_s:
        frame = sensor.wait(after=frame.index, timeout_s=5.0)
        rows.append((frame.index, frame.taken_s, frame.taken_s + 1e-3 * frame.latency_ms, frame.dropped))
    index, taken_s, done_s, dropped = (np.array(column) for column in zip(*rows, strict=True))
    settled = taken_s > taken_s[0] + SETTLED_S
    index, taken_s, done_s, dropped = index[settled], taken_s[settled], done_s[settled], dropped[settled]
    half_s = 0.5e-3 * camera.exposure_ms
    exposure = np.rint((taken_s + half_s - camera.began_s) * camera.fps)
    exposed_s = camera.began_s + exposure / camera.fps - half_s
    unreported = int(np.abs(np.diff(exposure) - np.diff(index)).sum())
    return Results(1e3 * (done_s - exposed_s), int(index[-1] - index[0]), int(dropped[1:].sum()), unreported)


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
    """Latency at two rates and of two sensors, then the results of one and of two sensors.

    Args:
        seconds: of each rate of one sensor.
        quick: few seconds.
    """
    seconds = QUICK_SECONDS if quick else seconds
    original = cv2.VideoCapture
    try:
        with tempfile.TemporaryDirectory(prefix="cmpdesign-latency-") as name:
            folder = Path(name)
            images = _write_layout(folder)
            short = min(seconds, PAIR_SECONDS)
            cases = [*((1, rate_hz, seconds) for rate_hz in RATES_HZ), (2, RATES_HZ[0], short)]
            latencies = [latency_row(folder, images, *case) for case in cases]
            yield Table("from the middle of the exposure to the result", LATENCY, latencies)
            alone, both = (throughput_row(folder, images, count, short) for count in (1, 2))
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
