"""The camera suite: inks, lamps, pad, lens, motion, sensor and file format, alone and combined at random.

    python -m benchmarks.camera [--pictures N] [--seed S] [--preset P] [--table] [--json FILE] [--page]
    python -m benchmarks.camera --seed S --only "exposure=0.75/72" --save DIR     one picture and its overlay

The default seed comes from the commit's hash and is printed. The same seed gives the same pictures. Each effect has
strengths of 0.25 to 1; the largest strengths are 0.1 or 8 times the light, 13 px of motion, JPEG at quality 15 and
similar.
Columns: the share of visible markers measured; wrong ids (reported at another marker's place) and wrong positions
(error above 0.3 of the shortest edge); RMS error per axis of measured markers that are not wrong; z, median z and the
share beyond of all measured markers, wrong ones included, with its interval; processor time of one picture, the
faster of two readings. Rows with "CIE76 20" are of pictures in which neighbouring cells differ by as much (5th
percentile over the pattern) at a pitch of 8 px or more: those of the effects of light and inks, and those of all.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from benchmarks.camera.page import publish, save_pictures, shown_results
from benchmarks.camera.report import (
    effect_rows,
    failure_lines,
    graded_rows,
    result_line,
    rows_table,
)
from benchmarks.suites.camera.cases import TURN, CameraCase, commit_seed, make_cases, parse_case
from benchmarks.suites.camera.reading import PictureResult, read_case, warm_up
from benchmarks.support.machine import conditions_text, write_json
from extractor.presets import PRESETS, Preset

PICTURES = 40 * len(TURN)


def read_cases(chosen: Sequence[CameraCase], preset: Preset, processes: int) -> Iterator[PictureResult]:
    """Results in the order of completion."""
    read = partial(read_case, preset=preset)
    if processes == 1:
        warm_up(preset)
        yield from map(read, chosen)
        return
    with multiprocessing.get_context("spawn").Pool(processes, warm_up, (preset,)) as pool:
        yield from pool.imap_unordered(read, chosen, chunksize=4)


def with_progress(chosen: Sequence[CameraCase], preset: Preset, processes: int) -> list[PictureResult]:
    """All results in the order of their numbers, with the progress on stderr."""
    results: list[PictureResult] = []
    started = time.perf_counter()
    for result in read_cases(chosen, preset, processes):
        results.append(result)
        if sys.stderr.isatty() or len(results) % 200 == 0:
            text = f"{len(results)}/{len(chosen)} pictures, {time.perf_counter() - started:.0f} s"
            print(text, end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)
    return sorted(results, key=lambda result: result.case.number)


def parse_options(arguments: list[str] | None) -> argparse.Namespace:
    """The options, with the seed that was given or that the commit gives."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.camera", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--pictures", type=int, default=PICTURES, metavar="N")
    parser.add_argument("--seed", type=int, metavar="S", help="repeat a run; else the commit's hash gives it")
    parser.add_argument("--preset", choices=PRESETS, default="balanced")
    parser.add_argument("--only", metavar="NAME", help="one picture: exposure=0.75/72, or its number")
    parser.add_argument(
        "--save", type=Path, metavar="DIR", help="with --only: write picture and overlay here"
    )
    parser.add_argument("--table", action="store_true", help="print every effect by strength, too")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every row")
    parser.add_argument(
        "--pictures-folder", type=Path, metavar="DIR", help="write what fails: pictures and overlays"
    )
    parser.add_argument(
        "--page",
        action="store_true",
        help="write docs/measured, and the part of docs/explanation/hard-cases.md",
    )
    parser.add_argument(
        "--processes", "--workers", type=int, default=min(2, os.cpu_count() or 1), metavar="N"
    )
    options = parser.parse_args(arguments)
    if options.pictures < 1:
        parser.error(f"--pictures is {options.pictures}; it must be at least 1")
    try:
        options.seed = commit_seed() if options.seed is None else options.seed
        options.case = parse_case(options.only, options.seed) if options.only else None
    except ValueError as error:
        parser.error(str(error))
    if options.seed < 0:
        parser.error(f"--seed is {options.seed}; it must be 0 or more")
    return options


def main(arguments: list[str] | None = None) -> int:
    """Print a row per effect and one of all pictures. Returns 1 if an id is wrong or a picture raised."""
    options = parse_options(arguments)
    if options.case:
        warm_up(options.preset)
        result = read_case(options.case, options.preset)
        print(result_line(result))
        if options.save:
            save_pictures([result], options.preset, options.save)
        return int(result.wrong_ids > 0 or result.raised)
    started = time.perf_counter()
    print(f"seed {options.seed}, {options.pictures} pictures, preset {options.preset}", flush=True)
    results = with_progress(make_cases(options.pictures, options.seed), options.preset, options.processes)
    rows, graded = effect_rows(results), graded_rows(results)
    print(rows_table([*graded, *rows] if options.table else rows))
    for line in failure_lines(results):
        print(line)
    print(conditions_text())
    print(
        f"repeat with --seed {options.seed} --pictures {options.pictures}; {time.perf_counter() - started:.0f} s"
    )
    found = {
        "seed": options.seed,
        "pictures": options.pictures,
        "preset": options.preset,
        "effects": [row.record() for row in rows],
        "graded": [row.record() for row in graded],
    }
    if options.json:
        write_json(options.json, found)
    if options.pictures_folder:
        save_pictures(shown_results(results), options.preset, options.pictures_folder)
    if options.page:
        for path in publish(found, rows, results):
            print(f"wrote {path}")
    return int(any(result.wrong_ids or result.raised for result in results))
