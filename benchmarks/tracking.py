"""Tracking over a long sequence: ids, error and time, compared with Lucas-Kanade optical flow on the same frames.

2,000 frames of 640x480 and 331 markers (quick: 120), pressed, twisted, sheared and moved. In the second
sequence the pattern also jumps at times by most of an edge, and some frames are black. Optical flow
starts from the true positions of the first frame. An id is wrong if its marker is nearer to another marker's true
position than to its own. Errors are per axis against the scene's truth. One core.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import (
    Camera,
    Press,
    Rendered,
    Shear,
    Twist,
    composed,
    render,
    standard_layout,
    standard_scene,
)
from extractor import FrameStatus, StartKind, Tracked, Tracker, parse_layout

FRAMES, QUICK_FRAMES = 2000, 120
AHEAD = 40  # frames that are rendered before they are tracked
BLOCKS = 10  # rows of the table
PERIOD = 90  # frames of a whole cycle of motion
JUMP_EVERY, BLACK_EVERY, BLACK_FRAMES = 97, 331, 4
SIZE = (640, 480)
Points = NDArray[np.float64]


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


class Followed(NamedTuple):
    """A sequence: errors of its frames, times of the tracker in ms by how it started, and the flow's mean time."""

    rows: list[FrameErrors]
    times_ms: dict[str, list[float]]
    not_tracked: int
    flow_ms: float
    largest_step_px: float


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
        scene = replace(standard_scene(layout, seed=index), camera=camera, surface=surface)
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


def follow(tracker: Tracker, frames: Iterator[Rendered]) -> Followed:
    """Track the frames with the tracker and with optical flow."""
    rows: list[FrameErrors] = []
    times: dict[str, list[float]] = {"warm": [], "warm, CPU time": [], "cold": []}
    flow: OpticalFlow | None = None
    flow_s, step_px, failed, before = 0.0, 0.0, 0, None
    for index, (rendered, frame, cpu_ms) in enumerate(track_frames(tracker, frames)):
        true, image = rendered.truth.marker_xy_px, np.asarray(rendered.image, np.uint8)
        if frame.start is StartKind.WARM:
            times["warm"].append(frame.elapsed_ms)
            times["warm, CPU time"].append(cpu_ms)
        elif frame.start is StartKind.COLD and index:  # the first frame loads code
            times["cold"].append(frame.elapsed_ms)
        failed += frame.status is not FrameStatus.TRACKED
        flow = flow or OpticalFlow(image, true)
        start = time.perf_counter()
        flowed = flow.track(image)
        flow_s += time.perf_counter() - start
        rows.append(frame_errors(frame.markers.xy_px, flowed, true))
        if before is not None:
            step_px = max(step_px, float(np.linalg.norm(true - before, axis=1).max()))
        before = true
    return Followed(rows, times, failed, 1e3 * flow_s / len(rows), step_px)


def frame_errors(xy_px: Points, flowed_px: Points, true_px: Points) -> FrameErrors:
    error = xy_px - true_px
    squares = error[np.isfinite(error)] ** 2
    return FrameErrors(
        squared=float(squares.mean()) if len(squares) else np.nan,
        worst=float(np.sqrt(np.nanmax((error**2).sum(axis=1)))) if len(squares) else np.nan,
        lost=int((~np.isfinite(error[:, 0])).sum()),
        wrong=wrong_ids(xy_px, true_px),
        flow_squared=float(np.mean((flowed_px - true_px) ** 2)),
        flow_wrong=wrong_ids(flowed_px, true_px),
    )


def error_table(name: str, rows: Sequence[FrameErrors]) -> Table:
    """Errors by tenths of the sequence: RMS per axis in px and wrong ids, of the tracker and of optical flow."""
    shown = []
    for numbers in np.array_split(np.arange(len(rows)), BLOCKS):
        block = [rows[number] for number in numbers]
        tracked = [row for row in block if np.isfinite(row.squared)]
        shown.append((
            f"{numbers[0]}-{numbers[-1]}", float(np.sqrt(np.mean([row.squared for row in tracked]))),
            max(row.worst for row in tracked), sum(row.lost for row in block), sum(row.wrong for row in block),
            float(np.sqrt(np.mean([row.flow_squared for row in block]))), sum(row.flow_wrong for row in block),
        ))  # fmt: skip
    halves = ("2nd half / 1st", *(error_growth([row[column] for row in shown]) for column in (1, 5)))
    columns = {"frames": TEXT, "RMS px": ".4f", "worst px": ".3f", "lost": "d", "wrong ids": "d"}
    columns |= {"flow: RMS px": ".3f", "flow: wrong ids": "d"}
    return Table(name, columns, [*shown, (*halves[:2], None, None, None, halves[2], None)])


def error_growth(rms_px: Sequence[float]) -> float:
    """The RMS of the second half over the RMS of the first half."""
    halves = np.split(np.square(rms_px), 2)
    return float(np.sqrt(halves[1].mean() / halves[0].mean()))


def time_table(name: str, found: Followed) -> Table:
    """Frames and times by how the tracker started."""
    rows: list[tuple[object, ...]] = []
    for start, times_ms in found.times_ms.items():
        percentiles = np.percentile(times_ms, (50, 95, 99)) if len(times_ms) else np.full(3, np.nan)
        rows.append((start, len(times_ms) + (start == "cold"), *map(float, percentiles)))
    rows += [
        ("not tracked", found.not_tracked, *[None] * 3),
        ("optical flow", len(found.rows), found.flow_ms, *[None] * 2),
    ]
    columns = {"start": TEXT, "frames": "d", "p50 ms": ".2f", "p95 ms": ".2f", "p99 ms": ".2f"}
    step = (
        f"largest step between frames {found.largest_step_px:.1f} px (pitch 20 px); of optical flow the mean"
    )
    return Table(f"{name}, times", columns, rows, step)


def measure(quick: bool = False) -> Shown:
    """Errors and times of both sequences.

    Args:
        quick: 120 frames.
    """
    count, layout = QUICK_FRAMES if quick else FRAMES, standard_layout(layers=10)
    for name, jerky in (("smooth", False), ("with jumps and black frames", True)):
        tracker = Tracker(parse_layout(layout_to_json(layout)))
        found = follow(tracker, render_sequence(layout, count, jerky))
        yield error_table(f"{name}, {count} frames, {len(layout.marker_layer)} markers", found.rows)
        yield time_table(name, found)


main = Experiment("tracking", measure)

if __name__ == "__main__":
    raise SystemExit(main())
