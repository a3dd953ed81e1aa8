"""Path-traced pictures of pads: pictures read, markers measured, wrong and invented markers, z, reasons, time.

Without a folder the pictures beside this program are read; their README.md names the families. Each picture is read
with the layout of its pad; the side is told, the camera's response is not. Columns: pictures with any marker; visible
markers, and the share of them that is measured; markers reported under another marker's id, and more than half an edge
from their place; markers reported where there is no pattern; pictures whose reason, or its absence, agrees with the
truth; processor time of a picture, the faster of two readings. Errors over covariances are of measured markers: of pads
as designed; of misregistered and scattered pads against the crossings of the cells' sides; of pads with relief against
the plane at half the height, against the plane of the black, and against that when the layout gives the height.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, OptionError, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.photoreal.page import page
from benchmarks.suites.photoreal.pictures import (
    NO_PATTERN,
    PICTURES_FOLDER,
    TracedPicture,
    first_of_families,
    load_pictures,
)
from benchmarks.suites.photoreal.reading import PLACES, TracedResult, read_picture
from benchmarks.suites.scoring.calibration import Calibration, calibration_table, summarise
from extractor.presets import Preset

POOLS = {"A to H, O": "ABCDEFGHO", "A to H": "ABCDEFGH", "I, L": "IL", "all but N": "ABCDEFGHOIL"}
COLUMNS = {
    "family": TEXT, "pictures": "d", "read": "d", "visible": "d", "measured": ".1%", "ids": "d", "places": "d",
    "invented": "d", "right reasons": "d", "p50 ms": ".1f", "max ms": ".1f", "reasons": TEXT,
}  # fmt: skip
RUNS = 2  # readings of a picture; the first one may load modules


def family_row(name: str, results: Sequence[TracedResult]) -> tuple[object, ...]:
    """The row of some pictures; at least one."""
    times_ms, visible = [result.ms for result in results], sum(result.visible for result in results)
    reasons = sorted(Counter(result.reason for result in results if result.reason).items())
    return (
        name,
        len(results),
        sum(result.is_read for result in results),
        visible,
        sum(result.measured for result in results) / visible if visible else None,
        sum(result.wrong_ids for result in results),
        sum(result.wrong_places for result in results),
        sum(result.reported for result in results if result.picture.family == NO_PATTERN),
        sum(result.is_reason_right for result in results),
        float(np.median(times_ms)),
        max(times_ms),
        ", ".join(f"{reason} {count}" for reason, count in reasons),
    )


def family_rows(results: Sequence[TracedResult]) -> list[tuple[object, ...]]:
    """A row for each family that has pictures, then the pools."""
    by_family: dict[str, list[TracedResult]] = {}
    for result in results:
        by_family.setdefault(result.picture.family, []).append(result)
    rows = [family_row(name, by_family[name]) for name in sorted(by_family)]
    for name, families in POOLS.items():
        pooled = [result for result in results if result.picture.family in families]
        if pooled:
            rows.append(family_row(name, pooled))
    return rows


def calibrations(results: Sequence[TracedResult]) -> dict[str, Calibration]:
    """Errors over covariances by ``PLACES``, without places of no picture."""
    found = {
        place: summarise([result.squares[place] for result in results if place in result.squares])
        for place in PLACES
    }
    return {place: calibration for place, calibration in found.items() if calibration.count}


def picture_line(result: TracedResult) -> str:
    """One picture on one line."""
    wrong = f", wrong ids {result.wrong_ids}, positions {result.wrong_places}"
    squares = ", ".join(
        f"z {summarise([d2]).z.value:.2f} ({place})" for place, d2 in result.squares.items() if len(d2)
    )
    reason = f", {result.reason}" if result.reason else ""
    reason += "" if result.is_reason_right else " (wrong reason)"
    return (
        f"{result.picture.name:<22} {result.measured} of {result.visible} measured, {result.reported} reported"
        f"{wrong}{', ' if squares else ''}{squares}, {result.ms:.0f} ms{reason}  [{', '.join(result.picture.effects)}]"
    )


def tables(results: Sequence[TracedResult]) -> list[Table]:
    """Families and pools, then errors over covariances of measured markers."""
    return [
        Table("path-traced pictures", COLUMNS, family_rows(results)),
        calibration_table("measured markers", calibrations(results)),
    ]


def measured_record(results: Sequence[TracedResult]) -> dict[str, Any]:
    """What docs/measured holds."""
    kept = (
        "visible",
        "measured",
        "reported",
        "wrong_ids",
        "wrong_places",
        "unmeasured",
        "reason",
        "is_reason_right",
        "ms",
    )
    return {
        "table": "\n\n".join(map(str, tables(results))),
        "rows": Table("", COLUMNS, family_rows(results)).records(),
        "calibration": {place: asdict(found) for place, found in calibrations(results).items()},
        "pictures": [
            {"name": result.picture.name, **{name: getattr(result, name) for name in kept}}
            for result in results
        ],
    }


def chosen_pictures(folder: Path, quick: bool, family: str) -> list[TracedPicture]:
    try:
        pictures = load_pictures(folder)
    except ValueError as error:
        raise OptionError(error) from None
    pictures = first_of_families(pictures) if quick else pictures
    pictures = [picture for picture in pictures if picture.family in (family.upper() or picture.family)]
    if not pictures:
        raise OptionError(f"no picture is of the families {family}")
    return pictures


def measure(
    quick: bool = False,
    folder: Path = PICTURES_FOLDER,
    family: str = "",
    preset: Preset = "balanced",
    each: bool = False,
    processes: int = PROCESSES,
) -> Shown:
    """A row per family and pool; fails if an id is wrong or a marker is invented.

    Args:
        quick: the first picture of every family.
        folder: with other pictures.
        family: letters of some families, as ABH.
        each: print a line for every picture, too.
    """
    pictures = chosen_pictures(folder, quick, family)
    results = results_of(partial(read_picture, preset=preset, runs=RUNS), pictures, processes, chunk=2)
    if each:
        yield from map(picture_line, results)
    yield from tables(results)
    invented = any(result.reported for result in results if result.picture.family == NO_PATTERN)
    return Found(measured_record(results), invented or any(result.wrong_ids for result in results))


main = Experiment("photoreal", measure, page)

if __name__ == "__main__":
    raise SystemExit(main())
