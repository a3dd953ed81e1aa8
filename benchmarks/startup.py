"""Whole processes: time to the first markers, of a command from the shell, and to build the largest pattern.

The time to the first markers is the processor's, the least of runs in turns with the import of the libraries alone; the
other times are by the clock. Python keeps compiled modules, as usual.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.frame.conditions import ROOT
from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed

CLI = "from cmpdesign.cli import main; main()"
COMMANDS = {
    "python -c pass": None,
    "cmpdesign --help": ["--help"],
    "cmpdesign templates": ["templates"],
    "cmpdesign build honeycomb --only svg,layout": [
        "build",
        "honeycomb",
        "--only",
        "svg,layout",
        "-o",
        "made",
    ],
    "cmpdesign build honeycomb": ["build", "honeycomb", "-o", "made"],
}
# From the start of a process to the markers of one PNG, and the import of the libraries alone.
LIBRARIES = "import numpy, cv2"
FIRST_MARKERS = """
import sys
import cv2
from extractor import Extractor, load_layout
markers = Extractor(load_layout("layout.json")).extract(cv2.imread("view.png"))
assert (markers.status == 1).sum() == 331, markers.reason
"""
PEAK = "\nimport resource; print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
# The child process reports its own peak memory, which the system states in kB.
LARGEST = """
import json, resource, sys, time
from cmpdesign import Design, build_layout
design = Design(pattern=sys.argv[1], layers=200, pitch_mm=1.0)
start = time.perf_counter()
layout = build_layout(design)
seconds = time.perf_counter() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"markers": len(layout.marker_xy_mm), "seconds": seconds, "peak_mb": peak / 1024}))
"""


@dataclass(frozen=True)
class FirstMarkers:
    """Processor seconds and peak memory up to the first markers, and of importing numpy and OpenCV alone."""

    seconds: float
    libraries_s: float
    peak_mb: float
    libraries_mb: float


def run_python(code: str, arguments: Sequence[str], folder: Path) -> str:
    """Run code in a new process, and return its output."""
    start = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
    command = [sys.executable, "-c", start + code, *arguments]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=True
    ).stdout


def children_s() -> float:
    """Seconds of the processor that child processes have taken so far."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def process_row(command: str, runs: int, folder: Path) -> tuple[str, float, float]:
    """A command, and its median and best seconds, after one run that is not timed, which reads the files from disk."""
    arguments = COMMANDS[command]
    run = partial(run_python, "pass" if arguments is None else CLI, arguments or [], folder)
    seconds = [timed(run).clock_ms / 1e3 for _ in range(runs + 1)]
    return command, float(np.median(seconds[1:])), min(seconds[1:])


def measure_first_markers(runs: int, folder: Path) -> FirstMarkers:
    """The least of runs in turns; the picture has 640x480 px and 331 markers."""
    run_python(CLI, ["build", "honeycomb", "--only", "layout", "-o", "."], folder)
    run_python(CLI, ["render", "layout.json", "-o", "view.png", "--noise", "2", "--size", "640x480"], folder)
    seconds: dict[str, list[float]] = {LIBRARIES: [], FIRST_MARKERS: []}
    peaks = {code: float(run_python(code + PEAK, [], folder)) for code in seconds}
    for _ in range(runs):
        for code, times in seconds.items():
            start = children_s()
            run_python(code, [], folder)
            times.append(children_s() - start)
    first, libraries = min(seconds[FIRST_MARKERS]), min(seconds[LIBRARIES])
    return FirstMarkers(first, libraries, peaks[FIRST_MARKERS], peaks[LIBRARIES])


def largest_row(pattern: str, runs: int, folder: Path) -> tuple[str, int, float, float]:
    results = [json.loads(run_python(LARGEST, [pattern], folder)) for _ in range(runs)]
    best = min(results, key=lambda result: float(result["seconds"]))
    return pattern, best["markers"], best["seconds"], best["peak_mb"]


def measure(quick: bool = False) -> Shown:
    """The first markers, commands, and the largest patterns.

    Args:
        quick: few runs.
    """
    runs = 3 if quick else 15
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first = measure_first_markers(runs, folder)
        yield (
            f"From the start of a process to the markers of one 640x480 PNG: {first.seconds:.3f} s, "
            f"{first.peak_mb:.0f} MB; import numpy, cv2 alone: {first.libraries_s:.3f} s, "
            f"{first.libraries_mb:.0f} MB; ratio {first.seconds / first.libraries_s:.2f}"
        )
        processes = [process_row(command, runs, folder) for command in COMMANDS]
        yield Table("whole processes", {"command": TEXT, "median s": ".3f", "best s": ".3f"}, processes)
        patterns = ("honeycomb", "round", "elliptical")
        largest = [largest_row(pattern, max(1, runs // 5), folder) for pattern in patterns]
    columns = {"pattern": TEXT, "markers": "d", "best s": ".2f", "peak MB": ".0f"}
    yield Table("200 layers in a fresh process", columns, largest)


main = Experiment("startup", measure)
main.run_as(__name__)
