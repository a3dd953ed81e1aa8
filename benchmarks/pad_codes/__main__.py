"""Parts of coded pads that are cropped and damaged, drawn crops, and pictures of pads of a family: right and wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Literal

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.parallel import PROCESSES
from benchmarks.frame.table import TEXT, Table
from benchmarks.pad_codes.beside import beside_table
from benchmarks.pad_codes.crops import crops_table
from benchmarks.pad_codes.families import VIEWS, told_apart
from benchmarks.pad_codes.parts import measured
from benchmarks.pad_codes.times import CASES, least_ms
from benchmarks.pad_codes.windows import placed_windows

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
        yield crops_table(crops, seed, processes)
    if only in ("all", "families"):
        yield families_table(layers, pictures, seed)
    if only in ("all", "beside"):
        yield beside_table(pictures, seed, processes)
    if only in ("all", "times"):
        yield times_table(readings)
    return None


def verdict_table(title: str, head: str, counts: Mapping[str, Counter[str]]) -> Table:
    """A row for the verdicts of each group."""
    rows = [
        (group, found.total(), found["right"] / found.total(), found["wrong"])
        for group, found in counts.items()
    ]
    return Table(title, {head: TEXT, "parts": "d", "right": ".2%", "wrong": "d"}, rows)


def parts_table(layers: int, parts: int, seed: int) -> Table:
    counts = dict(sorted(measured(layers, parts, seed).items()))
    return verdict_table(f"{layers} layers, {parts} parts", "bits", counts)


def families_table(layers: int, pictures: int, seed: int) -> Table:
    counts = {}
    for pads, share in VIEWS:
        for name, found in zip(
            ("own", "others"), told_apart(layers, pads, share, pictures, seed), strict=True
        ):
            counts[f"{pads} pads, {share:.0%} in view, {name}"] = found
    return verdict_table(f"pads of a family, {layers} layers", "pictures of", counts)


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
main.run_as(__name__)
