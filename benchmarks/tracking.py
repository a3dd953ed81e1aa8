"""Tracking over a long sequence: ids, error and time, compared with Lucas-Kanade optical flow on the same frames.

    python -m benchmarks.tracking [--quick] [--json FILE] [--plot FILE.png]

2,000 frames of 640x480 and 331 markers (quick: 120), pressed, twisted, sheared and moved. In the second
sequence the pattern also jumps at times by most of an edge, and some frames are black. Optical flow
starts from the true positions of the first frame. An id is wrong if its marker is nearer to another marker's true
position than to its own. Errors are per axis against the scene's truth. One core.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also as a script, from anywhere

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from scipy.spatial import cKDTree

from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import (
    Camera,
    Optics,
    Plain,
    Press,
    Rendered,
    Scene,
    Sensor,
    Shear,
    Twist,
    composed,
    render,
    standard_layout,
)
from cmpdesign.scene.standard import BLACK_RGB, INKS
from extractor import FrameStatus, StartKind, Tracked, Tracker, parse_layout

FRAMES, QUICK_FRAMES = 2000, 120
AHEAD = 40  # frames that are rendered before they are tracked
BLOCKS = 10  # rows of the table
PERIOD = 90  # frames of a whole cycle of motion
JUMP_EVERY, BLACK_EVERY, BLACK_FRAMES = 97, 331, 4
SIZE = (640, 480)


@dataclass(frozen=True)
class ErrorBlock:
    """Errors of some frames: RMS per axis in px and wrong ids, of the tracker and of optical flow."""

    first: int
    last: int
    rms_px: float
    worst_px: float
    lost: int
    wrong: int
    flow_rms_px: float
    flow_wrong: int


@dataclass(frozen=True)
class TrackingResult:
    """A sequence: its blocks, numbers of warm and cold starts, and times of the tracker in ms."""

    name: str
    frames: int
    markers: int
    blocks: list[ErrorBlock]
    warm_frames: int
    cold_frames: int
    not_tracked: int
    warm_ms: dict[str, float]
    warm_cpu_ms: dict[str, float]
    cold_ms: dict[str, float]
    flow_ms: float
    largest_step_px: float


class TrackedFrame(NamedTuple):
    """A rendered frame, its tracked markers, and the processor time of tracking in ms."""

    rendered: Rendered
    tracked: Tracked
    cpu_ms: float


class FrameErrors(NamedTuple):
    """Errors of one frame in px and px^2; NaN without markers."""

    squared: float
    worst: float
    lost: int
    wrong: int
    flow_squared: float
    flow_wrong: int


def render_sequence(layout: Layout, count: int, jerky: bool) -> Iterator[Rendered]:
    """The frames of a sequence; frame 0 is at rest. ``jerky``: with jumps and black frames."""
    rng = np.random.default_rng(1)
    offset = np.zeros(2)
    for index in range(count):
        turn = 2 * np.pi * index / PERIOD
        push = 0.5 - 0.5 * np.cos(turn)
        surface = composed(
            Press(4.0, 0.5 * push),
            Twist(6.0, 14 * np.sin(turn)),
            Shear(6.0, (0.5 * np.sin(1.7 * turn), 0.3 * push)),
        )
        if jerky and index and index % JUMP_EVERY == 0:
            angle = rng.uniform(0, 2 * np.pi)
            offset = -offset if offset.any() else 8.0 * np.array([np.cos(angle), np.sin(angle)])
        camera = Camera(
            pitch_px=20.0,
            rotation_deg=7.3 + 6 * np.sin(0.37 * turn),
            centre_px=(
                319.5 + 14 * np.sin(0.7 * turn) + offset[0],
                239.5 + 8 * np.sin(1.3 * turn) + offset[1],
            ),
        )
        scene = Scene(
            layout=layout,
            camera=camera,
            surface=surface,
            background=Plain(BLACK_RGB),
            optics=Optics(1.0),
            sensor=Sensor(noise=2.0),
            inks=INKS,
            seed=index,
        )
        rendered = render(scene, size=SIZE)
        if jerky and index and index % BLACK_EVERY < BLACK_FRAMES and index > BLACK_EVERY:
            rendered = Rendered(np.zeros_like(rendered.image), rendered.truth)
        yield rendered


def wrong_ids(xy_px: NDArray[np.float64], true_px: NDArray[np.float64]) -> int:
    """The number of found markers that are nearest to another marker's true position."""
    found = np.flatnonzero(np.isfinite(xy_px[:, 0]))
    return int((cKDTree(true_px).query(xy_px[found])[1] != found).sum())


class OpticalFlow:
    """Pyramidal Lucas-Kanade from the true positions in the first frame; a lost point keeps its position."""

    def __init__(self, image: NDArray[np.uint8], true_px: NDArray[np.float64]) -> None:
        self._gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        self._points = true_px.astype(np.float32)[:, None]

    def track(self, image: NDArray[np.uint8]) -> NDArray[np.float64]:
        gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        moved, good, _ = cv2.calcOpticalFlowPyrLK(
            self._gray,
            gray,
            self._points,
            None,
            winSize=(21, 21),
            maxLevel=3,  # type: ignore[call-overload]
        )
        self._points = np.where(good[:, :, None] == 1, moved, self._points)
        self._gray = gray
        return np.asarray(self._points[:, 0], dtype=np.float64)


def track_frames(tracker: Tracker, frames: Iterator[Rendered]) -> Iterator[TrackedFrame]:
    """Track frames in groups that are rendered in advance, so that frames follow each other as from a camera."""
    count = 0
    while part := list(islice(frames, AHEAD)):
        found = []
        for rendered in part:
            cpu = time.thread_time()
            frame = tracker.track(np.asarray(rendered.image, np.uint8), time_s=count / 30)
            found.append(TrackedFrame(rendered, frame, 1e3 * (time.thread_time() - cpu)))
            count += 1
        yield from found


def measure_sequence(name: str, layout: Layout, count: int, jerky: bool) -> TrackingResult:
    """Track the sequence with the tracker and with optical flow."""
    tracker = Tracker(parse_layout(layout_to_json(layout)))
    rows: list[FrameErrors] = []
    times: dict[str, list[float]] = {"warm": [], "cpu": [], "cold": []}
    flow: OpticalFlow | None = None
    flow_s, step_px, failed, before = 0.0, 0.0, 0, None
    for index, (rendered, frame, cpu) in enumerate(
        track_frames(tracker, render_sequence(layout, count, jerky))
    ):
        true, image = rendered.truth.marker_xy_px, np.asarray(rendered.image, np.uint8)
        if frame.start is StartKind.WARM:
            times["warm"].append(frame.elapsed_ms)
            times["cpu"].append(cpu)
        elif frame.start is StartKind.COLD and index:  # the first frame loads code
            times["cold"].append(frame.elapsed_ms)
        failed += frame.status is not FrameStatus.TRACKED
        flow = flow or OpticalFlow(image, true)
        start = time.perf_counter()
        flowed = flow.track(image)
        flow_s += time.perf_counter() - start
        error = frame.markers.xy_px - true
        squares = error[np.isfinite(error)] ** 2
        rows.append(
            FrameErrors(
                squared=float(squares.mean()) if len(squares) else np.nan,
                worst=float(np.sqrt(np.nanmax((error**2).sum(axis=1)))) if len(squares) else np.nan,
                lost=int((~np.isfinite(error[:, 0])).sum()),
                wrong=wrong_ids(frame.markers.xy_px, true),
                flow_squared=float(np.mean((flowed - true) ** 2)),
                flow_wrong=wrong_ids(flowed, true),
            )
        )
        step_px = (
            step_px if before is None else max(step_px, float(np.linalg.norm(true - before, axis=1).max()))
        )
        before = true
    return TrackingResult(
        name=name,
        frames=count,
        markers=len(layout.marker_layer),
        blocks=_error_blocks(rows),
        warm_frames=len(times["warm"]),
        cold_frames=len(times["cold"]) + 1,
        not_tracked=failed,
        warm_ms=percentiles(times["warm"]),
        warm_cpu_ms=percentiles(times["cpu"]),
        cold_ms=percentiles(times["cold"]),
        flow_ms=1e3 * flow_s / count,
        largest_step_px=step_px,
    )


def percentiles(values: Sequence[float]) -> dict[str, float]:
    found = np.percentile(values, (50, 95, 99)) if len(values) else np.full(3, np.nan)
    return dict(zip(("p50", "p95", "p99"), (float(v) for v in found), strict=True))


def _error_blocks(rows: Sequence[FrameErrors]) -> list[ErrorBlock]:
    blocks = []
    for numbers in np.array_split(np.arange(len(rows)), BLOCKS):
        block = [rows[number] for number in numbers]
        tracked = [row for row in block if np.isfinite(row.squared)]
        blocks.append(
            ErrorBlock(
                first=int(numbers[0]),
                last=int(numbers[-1]),
                rms_px=float(np.sqrt(np.mean([row.squared for row in tracked]))),
                worst_px=max(row.worst for row in tracked),
                lost=sum(row.lost for row in block),
                wrong=sum(row.wrong for row in block),
                flow_rms_px=float(np.sqrt(np.mean([row.flow_squared for row in block]))),
                flow_wrong=sum(row.flow_wrong for row in block),
            )
        )
    return blocks


def error_growth(rms_px: Sequence[float]) -> float:
    """The RMS of the second half over the RMS of the first half."""
    halves = np.split(np.square(rms_px), 2)
    return float(np.sqrt(halves[1].mean() / halves[0].mean()))


def result_tables(result: TrackingResult) -> list[Table]:
    errors = Table(box=SIMPLE_HEAD, title=f"{result.name}: {result.frames} frames, {result.markers} markers")
    for heading in ("frames", "RMS px", "worst px", "lost", "wrong ids", "flow: RMS px", "wrong ids"):
        errors.add_column(heading, justify="right")
    for block in result.blocks:
        numbers = (f"{block.rms_px:.4f}", f"{block.worst_px:.3f}", f"{block.lost}", f"{block.wrong}")
        errors.add_row(
            f"{block.first}-{block.last}", *numbers, f"{block.flow_rms_px:.3f}", f"{block.flow_wrong}"
        )
    ratios = [
        error_growth([getattr(block, name) for block in result.blocks]) for name in ("rms_px", "flow_rms_px")
    ]
    errors.add_row("2nd half / 1st", f"{ratios[0]:.2f}", "", "", "", f"{ratios[1]:.2f}", "")
    speed = Table(
        box=SIMPLE_HEAD, caption=f"largest step between frames {result.largest_step_px:.1f} px (pitch 20 px)"
    )
    for heading in ("start", "frames", "p50 ms", "p95 ms", "p99 ms"):
        speed.add_column(heading, justify="right")
    for name, count, times in (
        ("warm", result.warm_frames, result.warm_ms),
        ("warm, CPU time", result.warm_frames, result.warm_cpu_ms),
        ("cold", result.cold_frames, result.cold_ms),
    ):
        speed.add_row(name, f"{count}", *(f"{value:.2f}" for value in times.values()))
    speed.add_row("not tracked", f"{result.not_tracked}", "", "", "")
    speed.add_row("optical flow", f"{result.frames}", f"{result.flow_ms:.2f} mean", "", "")
    return [errors, speed]


def plot_errors(results: Sequence[TrackingResult], path: Path) -> None:
    """Plot the error of both methods over frames on a logarithmic scale."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        1, len(results), figsize=(5 * len(results), 3.6), sharey=True, squeeze=False
    )
    for axis, result in zip(axes[0], results, strict=True):
        at = [(block.first + block.last) / 2 for block in result.blocks]
        axis.semilogy(at, [b.flow_rms_px for b in result.blocks], "o-", color="#c05020", label="Lucas-Kanade")
        axis.semilogy(
            at, [b.rms_px for b in result.blocks], "s-", color="#2060a0", label="numbered in every frame"
        )
        axis.set(title=result.name, xlabel="frame", ylabel="RMS error per axis, px")
        axis.grid(True, which="both", alpha=0.3)
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_FRAMES} frames")
    parser.add_argument("--json", type=Path, help="also write the results here")
    parser.add_argument("--plot", type=Path, help="draw the errors here, as PNG")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    count = QUICK_FRAMES if options.quick else FRAMES
    layout = standard_layout(layers=10)
    results = [
        measure_sequence("smooth", layout, count, False),
        measure_sequence("with jumps and black frames", layout, count, True),
    ]
    console = Console(width=100)
    for result in results:
        for table in result_tables(result):
            console.print(table)
    console.print(conditions_text())
    figures: dict[str, Any] = {"sequences": [asdict(result) for result in results]}
    if options.json:
        write_json(options.json, figures)
    if options.plot:
        plot_errors(results, options.plot)


if __name__ == "__main__":
    main()
