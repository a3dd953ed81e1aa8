"""The stress suite: shares of read and of wrong markers in every condition of ``suites.stress``.

    python -m benchmarks.stress [--quick] [--table] [--json FILE] [--plot FILE]
    python -m benchmarks.stress --only "blur=3/round" --save DIR     some cases: their images and overlays

Times are processor times of one core, the best of some runs. Each run follows a run on the plain frame; the stated
ratio is the median of the ratios of such pairs.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.suites.scoring.reading import CaseResult, draw_overlay, notable_lines, read_case, warm_up
from benchmarks.suites.scoring.report import (
    calibration_table,
    condition_rows,
    failure_lines,
    plot_conditions,
    result_line,
    results_table,
    summary_text,
    write_json,
)
from benchmarks.suites.stress.conditions import BY_NAME, KINDS, make_cases, matching_cases
from benchmarks.suites.stress.kinds import StressCase

RUNS, FEW_RUNS = (
    15,
    5,
)  # per image, and per image of conditions with many images; a median of five errs by 0.03


def _read_case(job: tuple[StressCase, int]) -> CaseResult:
    return read_case(*job).result


def read_cases(chosen: list[StressCase], processes: int, runs: int) -> Iterator[CaseResult]:
    """Results in the order of completion; large images are read first."""
    last = [case for case in chosen if BY_NAME[case.kind].group != "view"]
    first = [case for case in chosen if BY_NAME[case.kind].group == "view"]
    # Conditions of many images need fewer runs of each.
    jobs = [
        (case, min(runs, FEW_RUNS) if BY_NAME[case.kind].group == "nothing" else runs)
        for case in [*first[::-1], *last]
    ]
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        yield from pool.imap_unordered(_read_case, jobs)


def with_progress(chosen: list[StressCase], processes: int, runs: int) -> list[CaseResult]:
    """All results, with the progress on stderr."""
    results, started = [], time.perf_counter()
    for result in read_cases(chosen, processes, runs):
        results.append(result)
        if sys.stderr.isatty() or len(results) % 200 == 0:
            text = f"{len(results)}/{len(chosen)} images, {time.perf_counter() - started:.0f} s"
            print(text, end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)
    return results


def read_one_by_one(chosen: list[StressCase], save: Path | None) -> list[CaseResult]:
    """Read in this process, print one line per case; write images and overlays into ``save``."""
    import cv2

    warm_up()
    results = []
    for case in chosen:
        result, shot, markers = read_case(case, 1)
        results.append(result)
        print(result_line(result))
        for line in notable_lines(shot, markers):
            print(f"    {line}")
        if save is not None:
            save.mkdir(parents=True, exist_ok=True)
            stem = case.name.replace("/", "-").replace(" ", "_")
            cv2.imwrite(str(save / f"{stem}.png"), shot.image)
            if markers is not None:
                cv2.imwrite(str(save / f"{stem}.overlay.png"), draw_overlay(shot, case, markers))
    return results


def main(arguments: list[str] | None = None) -> int:
    """Print the failures, the severest first, and the totals. Returns 1 if a marker is wrong or an image raised."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stress", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="the patterns take turns, no large images")
    parser.add_argument(
        "--only", metavar="NAME", help="one kind, condition or case: blur, blur=3, blur=3/round"
    )
    parser.add_argument(
        "--save", type=Path, metavar="DIR", help="with --only: write images and overlays here"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw every kind (png, svg or pdf)")
    parser.add_argument("--table", action="store_true", help="print every row, also in a quick run")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    options = parser.parse_args(arguments)

    started = time.perf_counter()
    if options.only:
        chosen = matching_cases(options.only)
        if not chosen:
            parser.error(f"no case is named {options.only!r}; the kinds are {', '.join(BY_NAME)}")
        results = read_one_by_one(chosen, options.save)
    else:
        results = with_progress(
            make_cases(quick=options.quick), options.processes, 1 if options.quick else RUNS
        )
    rows = condition_rows(results, KINDS)
    if options.table or not options.quick:
        print(results_table(rows))
    print("\n".join(failure_lines(rows)))
    print(calibration_table(results))
    print(f"{summary_text(rows)}; {len(BY_NAME)} kinds; {time.perf_counter() - started:.0f} s")
    if options.json:
        write_json(rows, options.json)
    if options.plot:
        plot_conditions(rows, KINDS, options.plot)
    return int(any(row.wrong or row.raised for row in rows))
