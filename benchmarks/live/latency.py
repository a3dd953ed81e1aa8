"""From the middle of the exposure to the result of a running sensor, and how many cores two sensors use.

    python -m benchmarks.live.latency [--seconds 30] [--json FILE]

``cmpdesign.open_sensor`` reads a camera with known exposure times in the place of OpenCV's: 640 x 480 px, 331 markers,
8 pictures of a press in turn, 4 ms of exposure. "p50", "p99", "worst": ms from the middle of the exposure to the
result, of all results after the first second. "dropped": share of the camera's frames without a result; "unreported":
frames without a result that no result counts, by the exposure times. For the figures of ten minutes give --seconds 600.

Then one sensor and two sensors on cameras of 400 frames a second, for a third of the time each: results a second,
the processor's time over the time by the clock, and the share of a second core that two sensors really use.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from benchmarks.support.machine import conditions_text, write_json
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import cmpdesign
from benchmarks.support.timed_camera import TimedCamera, in_the_place_of_opencv
from cmpdesign.scene import Press, render, standard_layout, standard_scene

RATES_HZ, FAST_HZ, SECONDS, SETTLED_S = (60.0, 120.0), 400.0, 30.0, 1.0
SIZE, LAYERS, PICTURES = (640, 480), 10, 8
SENSOR = """\
layout = "layout.json"
[[view]]
name = "camera"
focal_px = [900.0, 900.0]
centre_px = [319.5, 239.5]
[camera]
source = "{number}"
fps = {fps}
"""


@dataclass(frozen=True)
class Latency:
    """The latencies at a rate, ms, and the counts of frames."""

    rate_hz: float
    results: int
    p50_ms: float
    p99_ms: float
    worst_ms: float
    dropped: float
    unreported: int


@dataclass(frozen=True)
class Throughput:
    """Results a second of some sensors, and the cores that they use."""

    sensors: int
    results_per_s: float
    cores: float


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory(prefix="cmpdesign-latency-") as name:
        folder = Path(name)
        images = _write_layout(folder)
        latencies = [_latency(folder, images, rate_hz, chosen.seconds) for rate_hz in RATES_HZ]
        throughputs = [_throughput(folder, images, count, chosen.seconds / 3) for count in (1, 2)]
    _print(latencies, throughputs)
    if chosen.json:
        found = {
            "latency": [asdict(one) for one in latencies],
            "throughput": [asdict(one) for one in throughputs],
        }
        write_json(chosen.json, found)
    return int(any(one.unreported for one in latencies))


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
        path.write_text(SENSOR.format(number=number, fps=camera.fps))
    return cmpdesign.open_sensor(*paths)


def _latency(folder: Path, images: list[Any], rate_hz: float, seconds: float) -> Latency:
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
    return Latency(
        rate_hz,
        len(index),
        float(np.percentile(latency_ms, 50)),
        float(np.percentile(latency_ms, 99)),
        float(latency_ms.max()),
        1 - (len(index) - 1) / float(index[-1] - index[0]),
        unreported,
    )


def _throughput(folder: Path, images: list[Any], count: int, seconds: float) -> Throughput:
    with _opened(folder, [TimedCamera(images, FAST_HZ) for _ in range(count)]) as sensors:
        sensors.wait()
        time.sleep(SETTLED_S)
        began_s, cpu_s, before = time.monotonic(), time.process_time(), [one.count for one in sensors]
        time.sleep(seconds)
        spent_s, cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s
        done = sum(one.count for one in sensors) - sum(before)
    return Throughput(count, done / spent_s, cpu_s / spent_s)


def _print(latencies: list[Latency], throughputs: list[Throughput]) -> None:
    console = Console()
    console.print(conditions_text())
    table = Table("frames/s", "results", "p50", "p99", "worst, ms", "dropped", "unreported", box=SIMPLE_HEAD)
    for one in latencies:
        times = (f"{value:.1f}" for value in (one.p50_ms, one.p99_ms, one.worst_ms))
        table.add_row(f"{one.rate_hz:g}", f"{one.results}", *times, f"{one.dropped:.1%}", f"{one.unreported}")
    console.print(table)
    table = Table("sensors", "results/s", "cores", box=SIMPLE_HEAD)
    for each in throughputs:
        table.add_row(f"{each.sensors}", f"{each.results_per_s:.0f}", f"{each.cores:.2f}")
    console.print(table)
    alone, both = throughputs
    console.print(
        f"two sensors give {both.results_per_s / alone.results_per_s:.2f} times the results of one, and use "
        f"{both.cores - alone.cores:.0%} of a second core"
    )


if __name__ == "__main__":
    sys.exit(main())
