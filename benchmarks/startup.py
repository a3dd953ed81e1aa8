"""Whole processes: time to the first markers, time of a command from the shell, and time to build the largest pattern.

python -m benchmarks.startup [--quick] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also as a script, from anywhere

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.support.machine import conditions_text, write_json

ROOT = Path(__file__).resolve().parent.parent
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
class ProcessTime:
    """Wall-clock seconds of one command over several runs."""

    command: str
    median_s: float
    best_s: float


@dataclass(frozen=True)
class FirstMarkers:
    """Wall-clock seconds and peak memory up to the first markers, and of importing numpy and OpenCV alone."""

    seconds: float
    libraries_s: float
    peak_mb: float
    libraries_mb: float


@dataclass(frozen=True)
class LargestBuild:
    """Building 200 layers: the fastest run, and its process's peak memory."""

    pattern: str
    markers: int
    seconds: float
    peak_mb: float


def run_python(code: str, arguments: Sequence[str], folder: Path) -> str:
    """Run code in a new process, and return its output."""
    start = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
    command = [sys.executable, "-c", start + code, *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def measure_process(command: str, runs: int, folder: Path) -> ProcessTime:
    """Time a command after one run that is not timed, which reads the files from disk."""
    arguments = COMMANDS[command]
    seconds = []
    for _ in range(runs + 1):
        start = time.perf_counter()
        run_python("pass" if arguments is None else CLI, arguments or [], folder)
        seconds.append(time.perf_counter() - start)
    return ProcessTime(command, float(np.median(seconds[1:])), min(seconds[1:]))


def measure_first_markers(runs: int, folder: Path) -> FirstMarkers:
    """Medians over runs in turns; the picture has 640x480 px and 331 markers."""
    run_python(CLI, ["build", "honeycomb", "--only", "layout", "-o", "."], folder)
    run_python(CLI, ["render", "layout.json", "-o", "view.png", "--noise", "2", "--size", "640x480"], folder)
    seconds: dict[str, list[float]] = {LIBRARIES: [], FIRST_MARKERS: []}
    peaks = {code: float(run_python(code + PEAK, [], folder)) for code in seconds}
    for _ in range(runs):
        for code, times in seconds.items():
            start = time.perf_counter()
            run_python(code, [], folder)
            times.append(time.perf_counter() - start)
    first, libraries = (float(np.median(seconds[code])) for code in (FIRST_MARKERS, LIBRARIES))
    return FirstMarkers(first, libraries, peaks[FIRST_MARKERS], peaks[LIBRARIES])


def measure_largest(pattern: str, runs: int, folder: Path) -> LargestBuild:
    results = [json.loads(run_python(LARGEST, [pattern], folder)) for _ in range(runs)]
    best = min(results, key=lambda result: float(result["seconds"]))
    return LargestBuild(pattern, best["markers"], best["seconds"], best["peak_mb"])


def first_markers_text(first: FirstMarkers) -> str:
    return (
        f"From the start of a process to the markers of one 640x480 PNG: {first.seconds:.2f} s, "
        f"{first.peak_mb:.0f} MB; "
        f"import numpy, cv2 alone: {first.libraries_s:.2f} s, {first.libraries_mb:.0f} MB; "
        f"ratio {first.seconds / first.libraries_s:.2f}"
    )


def process_table(results: Sequence[ProcessTime]) -> Table:
    table = Table(title="Whole processes", box=SIMPLE_HEAD, title_justify="left")
    table.add_column("command", no_wrap=True)
    for name in ("median s", "best s"):
        table.add_column(name, justify="right", no_wrap=True)
    for result in results:
        table.add_row(result.command, f"{result.median_s:.3f}", f"{result.best_s:.3f}")
    return table


def largest_table(results: Sequence[LargestBuild]) -> Table:
    table = Table(title="200 layers in a fresh process", box=SIMPLE_HEAD, title_justify="left")
    table.add_column("pattern", no_wrap=True)
    for name in ("markers", "best s", "peak MB"):
        table.add_column(name, justify="right", no_wrap=True)
    for result in results:
        table.add_row(result.pattern, f"{result.markers}", f"{result.seconds:.2f}", f"{result.peak_mb:.0f}")
    return table


def main(arguments: list[str] | None = None) -> int:
    """Run, print the tables, write the JSON file if asked."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.startup", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few runs: a look, no figures to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results too")
    options = parser.parse_args(arguments)
    runs = 3 if options.quick else 15
    with tempfile.TemporaryDirectory() as folder:
        first = measure_first_markers(runs, Path(folder))
        processes = [measure_process(command, runs, Path(folder)) for command in COMMANDS]
        layouts = [
            measure_largest(pattern, max(1, runs // 5), Path(folder))
            for pattern in ("honeycomb", "round", "elliptical")
        ]
    console = Console()
    console.print(first_markers_text(first), soft_wrap=True)
    console.print(process_table(processes))
    console.print(largest_table(layouts))
    console.print(conditions_text(), style="dim", soft_wrap=True)
    if options.json:
        write_json(
            options.json,
            {
                "first_markers": asdict(first),
                "processes": [asdict(r) for r in processes],
                "largest": [asdict(r) for r in layouts],
            },
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
