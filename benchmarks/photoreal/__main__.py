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

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.frame.experiment import Experiment, Found, OptionError, Shown
from benchmarks.frame.parallel import PROCESSES, results_of
from benchmarks.frame.pooled import Columns, grouped, percentile, pooled_table, reasons, share, total
from benchmarks.frame.table import TEXT, Table
from benchmarks.photoreal.page import page
from benchmarks.suites.photoreal.pictures import (
    PICTURES_FOLDER,
    TracedPicture,
    first_of_families,
    load_pictures,
)
from benchmarks.suites.photoreal.reading import PLACES, TracedResult, read_picture
from benchmarks.suites.scoring.calibration import Calibration, calibration_table, summarise
from extractor.presets import Preset

POOLS = {"A to H, O": "ABCDEFGHO", "A to H": "ABCDEFGH", "I, L": "IL", "all but N": "ABCDEFGHOIL"}
COLUMNS: Columns = {
    "pictures": ("d", len),
    "read": ("d", total("is_read")),
    "visible": ("d", total("visible")),
    "measured": (".1%", share("measured", "visible")),
    "ids": ("d", total("wrong_ids")),
    "places": ("d", total("wrong_places")),
    "invented": ("d", total("invented")),
    "right reasons": ("d", total("is_reason_right")),
    "p50 ms": (".1f", percentile("ms", 50)),
    "max ms": (".1f", percentile("ms", 100)),
    "reasons": (TEXT, reasons),
}
RUNS = 2  # readings of a picture; the first one may load modules


def families_table(results: Sequence[TracedResult]) -> Table:
    """A row for each family that has pictures, then the pools."""
    by_family = grouped(sorted(results, key=lambda result: result.picture.family), "picture.family")
    pools = {
        name: [result for result in results if result.picture.family in families]
        for name, families in POOLS.items()
    }
    return pooled_table("path-traced pictures", "family", COLUMNS, {**by_family, **pools})


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
        families_table(results),
        calibration_table("measured markers", calibrations(results)),
    ]


def measured_record(results: Sequence[TracedResult]) -> dict[str, Any]:
    """What docs/measured holds."""
    kept = ("visible", "measured", "reported", "wrong_ids", "wrong_places", "unmeasured", "reason")
    kept += ("is_reason_right", "ms")
    return {
        "table": "\n\n".join(map(str, tables(results))),
        "rows": families_table(results).records(),
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
    return Found(measured_record(results), any(result.invented or result.wrong_ids for result in results))


main = Experiment("photoreal", measure, page)
main.run_as(__name__)
