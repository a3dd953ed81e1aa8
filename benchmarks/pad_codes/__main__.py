"""Parts of coded pads that are cropped and damaged, drawn crops, and pictures of pads of a family: right and wrong."""

from __future__ import annotations

from typing import Literal

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.parallel import PROCESSES
from benchmarks.frame.table import TEXT, Table
from benchmarks.pad_codes.beside import CODE, SUITES, figures_of
from benchmarks.pad_codes.crops import counted, read_crops
from benchmarks.pad_codes.families import VIEWS, told_apart
from benchmarks.pad_codes.parts import measured
from benchmarks.pad_codes.times import CASES, least_ms
from benchmarks.pad_codes.windows import placed_windows

COLUMNS = {"parts": "d", "right": ".2%", "wrong": "d"}


CROP_COLUMNS = {
    "crops": "d",
    "numbered": ".1%",
    "wrong ids": "d",
    "plain numbered": ".1%",
    "plain wrong ids": "d",
}
BESIDE_COLUMNS = {
    "pictures": "d", "unread": "d", "reported": ".1%", "wrong": "d", "RMS px": ".4f", "z": ".2f",
}  # fmt: skip
Part = Literal["all", "windows", "parts", "crops", "families", "beside", "times"]


def measure(
    only: Part = "all",
    layers: int = 10,
    codes: int = 16,
    parts: int = 100_000,
    crops: int = 120,
    pictures: int = 64,
    readings: int = 40,
    seed: int = 5,
    processes: int = PROCESSES,
) -> Shown:
    """One row for every group of parts, of crops, and for every family: its own pads, and others.

    Args:
        only: one of the tables.
        codes: the first ones, of which all windows are registered.
        crops: drawn ones with 60 and more black cells in view.
    """
    if only in ("all", "windows"):
        row = layers, *placed_windows(layers, codes, seed)
        yield Table("windows", {"layers": "d", "codes": "d", "windows": "d", "failed": "d"}, [row])
    if only in ("all", "parts"):
        yield parts_table(layers, parts, seed)
    if only in ("all", "crops"):
        found = counted(list(read_crops(crops, seed, processes))).items()
        rows = [
            (g, n.crops, n.coded / max(n.crops, 1), n.coded_wrong, n.plain / max(n.crops, 1), n.plain_wrong)
            for g, n in found
        ]
        yield Table("crops of pads of 5 to 11 layers", {"in view": TEXT, **CROP_COLUMNS}, rows)
    if only in ("all", "families"):
        yield families_table(layers, pictures, seed)
    if only in ("all", "beside"):
        yield beside_table(pictures, seed, processes)
    if only in ("all", "times"):
        yield times_table(readings)
    return None


def parts_table(layers: int, parts: int, seed: int) -> Table:
    counts = sorted(measured(layers, parts, seed).items())
    rows = [(group, found.total(), found["right"] / found.total(), found["wrong"]) for group, found in counts]
    return Table(f"{layers} layers, {parts} parts", {"bits": TEXT, **COLUMNS}, rows)


def families_table(layers: int, pictures: int, seed: int) -> Table:
    rows = []
    for pads, share in VIEWS:
        own, foreign = told_apart(layers, pads, share, pictures, seed)
        for name, found in (("own", own), ("others", foreign)):
            group = f"{pads} pads, {share:.0%} in view, {name}"
            rows.append((group, found.total(), found["right"] / found.total(), found["wrong"]))
    return Table(f"pads of a family, {layers} layers", {"pictures of": TEXT, **COLUMNS}, rows)


def beside_table(pictures: int, seed: int, processes: int) -> Table:
    rows = []
    for suite in SUITES:
        for name, code in (("coded", CODE), ("plain", 0)):
            found = figures_of(suite, code, pictures, seed, processes)
            row = found.unread, found.reported, found.wrong, found.rms_px, found.z
            rows.append((f"{suite}, {name}", pictures, *row))
    return Table("coded pads and plain ones", {"pads": TEXT, **BESIDE_COLUMNS}, rows)


def times_table(readings: int) -> Table:
    rows = []
    for case in CASES:
        plain, coded = least_ms(case, readings)
        size = f"{case.size[0]} x {case.size[1]}"
        rows.append((case.layers, case.pitch_px, size, plain, coded, coded - plain))
    columns = {
        "layers": "d",
        "edges px": "g",
        "picture": TEXT,
        "plain ms": ".2f",
        "coded ms": ".2f",
        "more ms": "+.2f",
    }
    return Table("processor time", columns, rows)


main = Experiment("pad_codes", measure)

if __name__ == "__main__":
    raise SystemExit(main())
