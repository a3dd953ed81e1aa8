"""Calibration of stated covariances: errors over covariances in all suites, for all presets.

    python -m benchmarks.calibration [--quick] [--preset NAME] [--suite NAME] [--seed S] [--json FILE]

For an error e and its stated covariance C, d2 = e' C^-1 e. z = sqrt(mean d2 / 2) and median z = sqrt(median d2 /
(2 ln 2)) are 1 for a right covariance, above 1 for a covariance that is too small; "beyond" is the share of d2 above
11.83, 0.27 % for normal errors with that covariance. Intervals are of 95 %, by bootstrap over pictures. All reported
markers count, wrong ones included. Rows are of measured markers and virtual markers by kind of picture; of each suite
together, also of repaired and fitted markers and of interpolated virtual markers. The default seed of the camera suite
comes from the commit's hash, the default of the other suites is 0. All seeds are printed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.suites.calibration.reading import (
    CalibrationRow,
    PictureReading,
    SuiteJob,
    calibration_rows,
    read_pictures,
)
from benchmarks.suites.calibration.suites import suites_by_name, usual_seed
from benchmarks.suites.scoring.calibration import calibration_head, calibration_line
from benchmarks.suites.scoring.reading import warm_up
from benchmarks.support.machine import conditions_text, write_json
from extractor.presets import PRESETS

PARTS = 8  # jobs per suite
NAME_WIDTH = 46


def read_jobs(jobs: Sequence[SuiteJob], processes: int) -> list[PictureReading]:
    """The readings of all jobs in the order of the suites, and of the pictures in each."""
    found: list[PictureReading] = []
    if processes == 1:
        warm_up()
        for job in jobs:
            found += read_pictures(job)
    else:
        with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
            for readings in pool.imap(read_pictures, jobs):
                found += readings
    suites = list(dict.fromkeys(job.suite for job in jobs))
    return sorted(found, key=lambda reading: (suites.index(reading.suite), reading.number))


def rows_text(rows: Sequence[CalibrationRow]) -> str:
    """One table per preset, with a heading per suite."""
    lines: list[str] = []
    preset, suite = "", ""
    for row in rows:
        if row.preset != preset:
            preset, suite = row.preset, ""
            lines += [*([""] if lines else []), calibration_head(preset, NAME_WIDTH)]
        if row.suite != suite:
            suite = row.suite
            lines.append(f"-- {suite}")
        lines.append(calibration_line(f"{row.kind}: {row.positions}", row.calibration, NAME_WIDTH))
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Read, print the tables, write the JSON file if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration", description=(__doc__ or "").split("\n")[0]
    )
    suites = tuple(suites_by_name())
    parser.add_argument("--quick", action="store_true", help="few pictures: a look, no figures to quote")
    parser.add_argument("--preset", choices=tuple(PRESETS), help="one preset; all by default")
    parser.add_argument("--suite", choices=suites, help="one suite; all by default")
    parser.add_argument("--seed", type=int, metavar="S", help="of all random choices, of all suites")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    presets = (options.preset,) if options.preset else tuple(PRESETS)
    chosen = (options.suite,) if options.suite else suites
    try:
        seeds = {suite: usual_seed(suite) if options.seed is None else options.seed for suite in chosen}
    except ValueError as error:
        parser.error(str(error))
    if min(seeds.values()) < 0:
        parser.error(f"--seed is {options.seed}; it must be 0 or more")
    jobs = [
        SuiteJob(suite, presets, options.quick, seed, part, PARTS)
        for suite, seed in seeds.items()
        for part in range(PARTS)
    ]
    readings = read_jobs(jobs, options.processes)
    rows = calibration_rows(readings)
    print(rows_text(rows))
    pictures = len({(reading.suite, reading.number) for reading in readings})
    text = ", ".join(f"{suite} {seed}" for suite, seed in seeds.items())
    print(f"{pictures} pictures, seed of {text}; {time.perf_counter() - started:.0f} s")
    print(conditions_text())
    if options.json:
        write_json(options.json, {"seeds": seeds, "rows": [asdict(row) for row in rows]})
    return 0


if __name__ == "__main__":
    sys.exit(main())
