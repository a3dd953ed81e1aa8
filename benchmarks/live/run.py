"""Time of live viewers and files per frame, and the length of the queue during a minute at 120 frames a second.

    python -m benchmarks.live [--quick] [--json FILE]

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

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.support.machine import conditions_text, write_json
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


@dataclass(frozen=True)
class Cost:
    """Time of an output per frame, in ms."""

    output: str
    ms: float
    of_tracking: float
    held_up_ms: float


@dataclass(frozen=True)
class Stream:
    """Frames sent to a client at a rate."""

    client: str
    rate_hz: float
    sent: int
    left_out: int
    seen: int
    largest_queue: int
    grown_mb: float
    is_viewer_behind: bool


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


def costs(material: Material) -> list[Cost]:
    """One for each output whose library is installed."""
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
            found.append(Cost(name, ms, ms / material.tracking_ms, held))
    return found


def resident_mb() -> float:
    """The memory of this process; nan where the system does not state it."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * 4096 / 1e6
    except OSError:
        return float("nan")


def stream(material: Material, seconds: float, rate_hz: float | None, is_stalled: bool = False) -> Stream:
    """Send frames for some seconds; without a rate, whenever the queue has room."""
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
    return Stream(
        name, count / elapsed, done.sent, done.left_out, seen, largest, grown, done.is_viewer_behind
    )


def _wait_for_turn(view: LiveView, started: float, count: int, rate_hz: float | None) -> None:
    if rate_hz is not None:
        time.sleep(max(0.0, started + count / rate_hz - time.perf_counter()))
        return
    while view.waiting() >= QUEUE_FRAMES - 1:
        time.sleep(0.0005)


def cost_table(found: Sequence[Cost], tracking_ms: float) -> Table:
    """The table of costs."""
    title = f"Outputs; tracking takes {tracking_ms:.1f} ms of the processor a frame"
    table = Table(title=title, box=SIMPLE_HEAD, title_justify="left", pad_edge=False)
    for name in ("output", "ms", "of tracking", "held up ms"):
        table.add_column(name, justify="left" if name == "output" else "right", no_wrap=True)
    for one in found:
        table.add_row(one.output, f"{one.ms:.2f}", f"{one.of_tracking:.3f}", f"{one.held_up_ms:.3f}")
    return table


def stream_table(found: Sequence[Stream]) -> Table:
    """The table of streams."""
    table = Table(title="Into Foxglove", box=SIMPLE_HEAD, title_justify="left", pad_edge=False)
    for name in ("client", "Hz", "sent", "left out", "seen", "queue", "grown MB"):
        table.add_column(name, justify="left" if name == "client" else "right", no_wrap=True)
    for one in found:
        numbers = (one.sent, one.left_out, one.seen, one.largest_queue)
        table.add_row(one.client, f"{one.rate_hz:.0f}", *map(str, numbers), f"{one.grown_mb:.1f}")
    return table


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the tables, write the JSON file if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.live", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help="few frames: a look, no figures to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure, too")
    options = parser.parse_args(arguments)
    material = track_frames(QUICK_FRAMES if options.quick else FRAMES)
    found = costs(material)
    seconds = QUICK_SECONDS if options.quick else SECONDS
    streams = [
        stream(material, seconds, RATE_HZ),
        stream(material, seconds, RATE_HZ, is_stalled=True),
        stream(material, seconds / 6, None),
    ]
    console = Console()
    console.print(cost_table(found, material.tracking_ms))
    console.print(stream_table(streams))
    console.print(conditions_text(), style="dim", soft_wrap=True)
    if options.json:
        lists = {"costs": list(map(asdict, found)), "streams": list(map(asdict, streams))}
        write_json(options.json, {"tracking_ms": material.tracking_ms, **lists})
    return 0


if __name__ == "__main__":
    sys.exit(main())
