"""Tracking over a long sequence: ids, error and time, compared with Lucas-Kanade optical flow on the same frames.

2,000 frames of 640x480 and 331 markers (quick: 120), pressed, twisted, sheared and moved. In the second
sequence the pattern also jumps at times by most of an edge, and some frames are black. Optical flow
starts from the true positions of the first frame. An id is wrong if its marker is nearer to another marker's true
position than to its own. Errors are per axis against the scene's truth. One core.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.pooled import Columns, Figure, mean, percentile, pooled_table, rms_of, total
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
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
from extractor import FrameStatus, StartKind, Tracker, parse_layout

FRAMES, QUICK_FRAMES = 2000, 120
AHEAD = 40  # frames that are rendered before they are tracked
BLOCKS = 10  # rows of the table
PERIOD = 90  # frames of a whole cycle of motion
JUMP_EVERY, BLACK_EVERY, BLACK_FRAMES = 97, 331, 4
SIZE = (640, 480)
Points = NDArray[np.float64]


class FollowedFrame(NamedTuple):
    """One frame: how and in what time it was tracked, and the errors of the tracker and of optical flow.

    Attributes:
        start, is_tracked: see ``Tracked``.
        elapsed_ms, cpu_ms, flow_ms: time of the tracker by the clock and of the processor; of the flow by the clock.
        squared, flow_squared: mean squared errors per axis, px^2; NaN without markers.
        worst: largest error, px.
        lost, wrong, flow_wrong: markers.
        step_px: the largest motion of a marker since the frame before.
    """

    start: StartKind | None
    is_tracked: bool
    elapsed_ms: float
    cpu_ms: float
    flow_ms: float
    squared: float
    worst: float
    lost: int
    wrong: int
    flow_squared: float
    flow_wrong: int
    step_px: float


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


def follow(tracker: Tracker, frames: Iterator[Rendered]) -> Iterator[FollowedFrame]:
    """Track the frames with the tracker and with optical flow.

    Frames are rendered in groups in advance, so that they follow each other as from a camera.
    """
    flow: OpticalFlow | None = None
    before = None
    while part := list(islice(frames, AHEAD)):
        images = [np.asarray(rendered.image, np.uint8) for rendered in part]
        tracked = [timed(partial(tracker.track, image)) for image in images]
        for image, rendered, one in zip(images, part, tracked, strict=True):
            true, xy_px = rendered.truth.marker_xy_px, one.result.markers.xy_px
            flow = flow or OpticalFlow(image, true)
            flowed = timed(partial(flow.track, image))
            error = xy_px - true
            yield FollowedFrame(
                one.result.start, one.result.status is FrameStatus.TRACKED, one.result.elapsed_ms, one.cpu_ms,
                flowed.clock_ms, squared=rms_of(error) ** 2,
                worst=float(np.sqrt(np.nanmax((error**2).sum(axis=1)))) if np.isfinite(error).any() else np.nan,
                lost=int((~np.isfinite(error[:, 0])).sum()), wrong=wrong_ids(xy_px, true),
                flow_squared=rms_of(flowed.result - true) ** 2, flow_wrong=wrong_ids(flowed.result, true),
                step_px=0.0 if before is None else float(np.linalg.norm(true - before, axis=1).max()),
            )  # fmt: skip
            before = true


def _root_of_mean(name: str) -> Figure:
    return lambda frames: rms_of(np.sqrt([getattr(one, name) for one in frames]))


ERRORS: Columns = {
    "RMS px": (".4f", _root_of_mean("squared")),
    "worst px": (".3f", percentile("worst", 100)),
    "lost": ("d", total("lost")),
    "wrong ids": ("d", total("wrong")),
    "flow: RMS px": (".3f", _root_of_mean("flow_squared")),
    "flow: wrong ids": ("d", total("flow_wrong")),
}


def error_table(name: str, frames: Sequence[FollowedFrame]) -> Table:
    """Errors by tenths of the sequence: RMS per axis in px and wrong ids, of the tracker and of optical flow."""
    blocks = np.array_split(np.arange(len(frames)), BLOCKS)
    groups = {f"{part[0]}-{part[-1]}": [frames[number] for number in part] for part in blocks}
    table = pooled_table(name, "frames", ERRORS, groups)
    own, flow = (error_growth([row[column] for row in table.rows]) for column in (1, 5))
    return replace(table, rows=[*table.rows, ("2nd half / 1st", own, None, None, None, flow, None)])


def error_growth(rms_px: Sequence[float]) -> float:
    """The RMS of the second half over the RMS of the first half."""
    halves = np.split(np.asarray(rms_px), 2)
    return rms_of(halves[1]) / rms_of(halves[0])


def time_table(name: str, frames: Sequence[FollowedFrame]) -> Table:
    """Frames and times by how the tracker started."""
    warm, cold = ([one for one in frames if one.start is kind] for kind in (StartKind.WARM, StartKind.COLD))
    later = [one for one in cold if one is not frames[0]]  # the first frame loads code
    rows: list[tuple[object, ...]] = [
        (start, len(every), *(percentile(field, percent)(some) for percent in (50, 95, 99)))
        for start, every, some, field in (
            ("warm", warm, warm, "elapsed_ms"), ("warm, CPU time", warm, warm, "cpu_ms"),
            ("cold", cold, later, "elapsed_ms"),
        )
    ]  # fmt: skip
    rows.append(("not tracked", sum(not one.is_tracked for one in frames), *[None] * 3))
    rows.append(("optical flow", len(frames), mean("flow_ms")(frames), *[None] * 2))
    columns = {"start": TEXT, "frames": "d", "p50 ms": ".2f", "p95 ms": ".2f", "p99 ms": ".2f"}
    step_px = max(one.step_px for one in frames)
    step = f"largest step between frames {step_px:.1f} px (pitch 20 px); of optical flow the mean"
    return Table(f"{name}, times", columns, rows, step)


def measure(quick: bool = False) -> Shown:
    """Errors and times of both sequences.

    Args:
        quick: 120 frames.
    """
    count, layout = QUICK_FRAMES if quick else FRAMES, standard_layout(layers=10)
    for name, jerky in (("smooth", False), ("with jumps and black frames", True)):
        tracker = Tracker(parse_layout(layout_to_json(layout)))
        frames = list(follow(tracker, render_sequence(layout, count, jerky)))
        yield error_table(f"{name}, {count} frames, {len(layout.marker_layer)} markers", frames)
        yield time_table(name, frames)


main = Experiment("tracking", measure)
main.run_as(__name__)
