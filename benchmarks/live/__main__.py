"""Time of live viewers and files per frame, and the length of the queue during a minute at 120 frames a second.

60 frames of 640 x 480 px (quick: 12), 331 markers, are tracked with the preset "balanced"; then every file and every
live viewer receives them. "ms" is the processor's time of all threads for one frame, to the complete file; "of
tracking" its ratio to the processor's time that tracking takes, in the same run. "held up" is the time that the tracker
waits.

A minute (quick: 5 s) at 120 frames a second into Foxglove's server, with a client in a process of its own that reads,
and with one that does not: frames sent, left out before the server, and seen by the client; the largest number of
frames that waited; growth of this process's memory over the last nine tenths. At last the largest rate with a client
that reads.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.tracking import render_sequence
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import standard_layout
from cmpdesign.tracking.live.options import Live
from cmpdesign.tracking.live.view import QUEUE_FRAMES, LiveView, open_view
from cmpdesign.tracking.recording.options import Recording
from cmpdesign.tracking.sinks.tables import open_sink
from cmpdesign.tracking.table import TrackTable
from extractor import Tracker, parse_layout

FRAMES, QUICK_FRAMES = 60, 12
RATE_HZ, SECONDS, QUICK_SECONDS = 120.0, 60.0, 5.0
FILES = (".npz", ".csv", ".mcap", ".rrd")
VIEWERS = ("foxglove", "rerun")


COSTS = {"output": TEXT, "ms": ".2f", "of tracking": ".3f", "held up ms": ".3f"}
STREAMS = {
    "client": TEXT, "Hz": ".0f", "sent": "d", "left out": "d", "seen": "d", "queue": "d", "grown MB": ".1f",
}  # fmt: skip


@dataclass(frozen=True)
class Material:
    """Tracked frames, their table, and the processor's time of tracking, ms a frame."""

    frames: Sequence[Any]
    table: TrackTable
    tracking_ms: float


def track_frames(count: int) -> Material:
    """Track the rendered sequence."""
    layout = standard_layout()
    images = [one.image for one in islice(render_sequence(layout, count, jerky=False), count)]
    reference = parse_layout(layout_to_json(layout))
    Tracker(reference).track(images[0])  # code that is loaded and compiled at first use
    tracker = Tracker(reference)
    started = time.process_time()
    frames = [tracker.track(image, time_s=k / 30) for k, image in enumerate(images)]
    return Material(frames, TrackTable(tracker), 1e3 * (time.process_time() - started) / count)


def cost_rows(material: Material) -> list[tuple[object, ...]]:
    """A row of ``COSTS`` for each output whose library is installed."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in (*FILES, *VIEWERS):
            if name in (".rrd", "rerun") and find_spec("rerun") is None:
                continue
            output: Any
            if name in FILES:
                output = open_sink(Path(folder) / f"run{name}", material.table)
            else:
                output = open_view(Live(name, 0), material.table, Recording())  # type: ignore[arg-type]
            started, waited = time.process_time(), 0.0
            for frame in material.frames:
                before = time.perf_counter()
                output.add(frame)
                waited += time.perf_counter() - before
            output.close()
            ms = 1e3 * (time.process_time() - started) / len(material.frames)
            held = 1e3 * waited / len(material.frames)
            found.append((name, ms, ms / material.tracking_ms, held))
    return found


def resident_mb() -> float:
    """The memory of this process; nan where the system does not state it."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * 4096 / 1e6
    except OSError:
        return float("nan")


def stream_row(
    material: Material, seconds: float, rate_hz: float | None, is_stalled: bool = False
) -> tuple[object, ...]:
    """The row of ``STREAMS`` after sending frames for some seconds; without a rate, whenever the queue has room."""
    view = open_view(Live("foxglove", 0), material.table, Recording())
    words = [sys.executable, "-m", "benchmarks.live.client", view.address.rpartition(":")[2]]
    words += ["--stalled"] if is_stalled else []
    client = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    view.wait(10)
    largest, memory, count = 0, [], 0
    started = time.perf_counter()
    for frame in cycle(material.frames):
        now = time.perf_counter() - started
        if now > seconds:
            break
        _wait_for_turn(view, started, count, rate_hz)
        view.add(frame)
        largest, count = max(largest, view.waiting()), count + 1
        if now > seconds / 10 and count % 16 == 0:
            memory.append(resident_mb())
    elapsed = time.perf_counter() - started
    grown = memory[-1] - memory[0] if memory else float("nan")
    done = view.close()
    seen = int(client.communicate("")[0])
    name = "does not read" if is_stalled else "reads"
    return name, count / elapsed, done.sent, done.left_out, seen, largest, grown


def _wait_for_turn(view: LiveView, started: float, count: int, rate_hz: float | None) -> None:
    if rate_hz is not None:
        time.sleep(max(0.0, started + count / rate_hz - time.perf_counter()))
        return
    while view.waiting() >= QUEUE_FRAMES - 1:
        time.sleep(0.0005)


def measure(quick: bool = False) -> Shown:
    """Costs of outputs, then streams into Foxglove.

    Args:
        quick: few frames and seconds.
    """
    material = track_frames(QUICK_FRAMES if quick else FRAMES)
    yield f"tracking takes {material.tracking_ms:.1f} ms of the processor a frame"
    yield Table("outputs", COSTS, cost_rows(material))
    seconds = QUICK_SECONDS if quick else SECONDS
    streams = [
        stream_row(material, seconds, RATE_HZ),
        stream_row(material, seconds, RATE_HZ, is_stalled=True),
        stream_row(material, seconds / 6, None),
    ]
    yield Table("streams into Foxglove", STREAMS, streams)


main = Experiment("live", measure)
main.run_as(__name__)
