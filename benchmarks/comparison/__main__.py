"""Speed against error: our presets, what else finds such corners, and the article's way, on the same scenes.

    python -m benchmarks.comparison [--quick] [--json FILE] [--publish]

640 x 480 px, edges of 20 px, rotated by 7.3 degrees, blur 1 px, noise 2/255: honeycomb with 397 markers flat, tilted by
35 degrees, bulged and twisted; round and elliptical patterns flat. Detectors of checkerboards read a board of 400 inner
corners with the same edge length, camera and surface, in black and white only, as gray image.
One thread each, processor time. The repetitions of all methods alternate, each with its own noise. Before every timed
frame a method reads another frame, not timed, as in a stream.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import asdict
from pathlib import Path

# before numpy, numba and chess-corners: times are of one core
os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = os.environ["RAYON_NUM_THREADS"] = "1"

import cv2
from rich.console import Console

from benchmarks.suites.comparison.measure import CASES, MethodResult, measure_case
from benchmarks.suites.comparison.report import comparison_markdown, scene_table
from benchmarks.support.machine import conditions_text, write_json
from benchmarks.support.published import write_published

REPETITIONS, QUICK_REPETITIONS = 11, 3


def main(arguments: list[str] | None = None) -> int:
    """Measure, print one table per scene; write the JSON file or the documentation on request."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.comparison", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--quick", action="store_true", help="few repetitions: a look, no figures to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results too")
    parser.add_argument(
        "--publish", action="store_true", help="write docs/measured and the pages that show it"
    )
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    repetitions = QUICK_REPETITIONS if options.quick else REPETITIONS
    terminal = Console()
    console = terminal if terminal.is_terminal else Console(width=150)  # a pipe has no width
    results: list[MethodResult] = []
    for case in CASES:
        results += measure_case(case, repetitions)
        console.print(scene_table(case.name, results, f"{repetitions} repetitions"))
    console.print(conditions_text(), style="dim", soft_wrap=True)
    found = {"repetitions": repetitions, "results": [asdict(result) for result in results]}
    if options.json:
        write_json(options.json, found)
    if options.publish:
        for path in write_published(
            "comparison", found, {"comparison": comparison_markdown(results), "conditions": conditions_text()}
        ):
            console.print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
