"""Path-traced pictures of pads: pictures read, markers measured, wrong and invented markers, z, reasons, time.

    python -m benchmarks.photoreal [FOLDER] [--each] [--preset P ...] [--family LETTERS] [--json FILE] [--publish]

Without a folder the pictures beside this program are read; their README.md names the families. Each picture is read
with the layout of its pad; the side is told, the camera's response is not. Columns: pictures with any marker; visible
markers, and the share of them that is measured; markers reported under another marker's id, and more than half an edge
from their place; markers reported where there is no pattern; pictures whose reason, or its absence, agrees with the
truth; processor time of a picture, the faster of two readings. Errors over covariances are of measured markers: of pads
as designed; of misregistered and scattered pads against the crossings of the cells' sides; of pads with relief against
the plane at half the height, against the plane of the black, and against that when the layout gives the height.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks.photoreal.page import publish
from benchmarks.photoreal.report import (
    calibration_table,
    calibrations,
    family_rows,
    measured_record,
    picture_line,
    rows_table,
)
from benchmarks.suites.photoreal.pictures import (
    PICTURES_FOLDER,
    TracedPicture,
    first_of_families,
    load_pictures,
)
from benchmarks.suites.photoreal.reading import TracedResult, read_picture
from benchmarks.support.command import publishing_parser
from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.workers import worker_pool
from extractor.presets import PRESETS, Preset

RUNS = 2  # readings of a picture; the first one may load modules


def parse_options(arguments: list[str] | None) -> argparse.Namespace:
    """The options; several presets are compared."""
    parser = publishing_parser("photoreal", __doc__, "pictures, the first of every family")
    parser.add_argument("folder", nargs="?", type=Path, default=PICTURES_FOLDER, metavar="FOLDER")
    parser.add_argument("--each", action="store_true", help="print a line for every picture, too")
    parser.add_argument("--family", metavar="LETTERS", help="some families, as ABH")
    parser.add_argument(
        "--preset", choices=PRESETS, action="append", help="more than once: compare presets; else balanced"
    )
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    options = parser.parse_args(arguments)
    if options.publish and (options.folder != PICTURES_FOLDER or options.quick or options.family):
        parser.error("--publish is for all of the project's pictures; leave FOLDER, --quick and --family out")
    try:
        options.pictures = load_pictures(options.folder)
    except ValueError as error:
        parser.error(str(error))
    if options.quick:
        options.pictures = first_of_families(options.pictures)
    if options.family:
        options.pictures = [
            picture for picture in options.pictures if picture.family in options.family.upper()
        ]
    if not options.pictures:
        parser.error(f"no picture is of the families {options.family}")
    options.preset = options.preset or ["balanced"]
    return options


def read_pictures(pictures: Sequence[TracedPicture], preset: Preset, processes: int) -> list[TracedResult]:
    """The results in the pictures' order."""
    read = partial(read_single_threaded, preset=preset)
    if processes == 1:
        return [read(picture) for picture in pictures]
    with worker_pool(processes) as pool:
        return list(pool.map(read, pictures, chunksize=2))


def read_single_threaded(picture: TracedPicture, preset: Preset) -> TracedResult:
    """``read_picture`` with one thread, so that processor times are comparable."""
    import cv2

    cv2.setNumThreads(1)
    return read_picture(picture, preset, RUNS)


def main(arguments: list[str] | None = None) -> int:
    """Print a row per family and pool. Returns 1 if an id is wrong or a marker is invented."""
    options = parse_options(arguments)
    failed, found = False, {}
    for preset in options.preset:
        started = time.perf_counter()
        results = read_pictures(options.pictures, preset, options.processes)
        print(f"{len(results)} pictures, preset {preset}, {time.perf_counter() - started:.0f} s")
        if options.each:
            print("\n".join(map(picture_line, results)))
        rows = family_rows(results)
        print(f"{rows_table(rows)}\n{calibration_table(calibrations(results))}", flush=True)
        failed |= any(result.wrong_ids for result in results) or any(row.invented for row in rows)
        found[preset] = measured_record(results)
    print(conditions_text())
    if options.json:
        write_json(options.json, found)
    if options.publish:
        for path in publish(found[options.preset[0]]):
            print(f"wrote {path}")
    return int(failed)
