"""Parts of coded pads that are cropped and damaged, and pictures of pads of a family: right and wrong."""

from __future__ import annotations

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.pad_codes.families import VIEWS, told_apart
from benchmarks.pad_codes.parts import measured

COLUMNS = {"parts": "d", "right": ".2%", "wrong": "d"}


def measure(layers: int = 10, parts: int = 100_000, pictures: int = 64, seed: int = 5) -> Shown:
    """One row for every group of parts, and for every family: its own pads, and others."""
    counts = measured(layers, parts, seed)
    rows = [
        (group, found.total(), found["right"] / found.total(), found["wrong"])
        for group, found in sorted(counts.items())
    ]
    yield Table(f"{layers} layers, {parts} parts", {"bits": TEXT, **COLUMNS}, rows)
    rows = []
    for pads, share in VIEWS:
        own, foreign = told_apart(layers, pads, share, pictures, seed)
        for name, found in (("own", own), ("others", foreign)):
            group = f"{pads} pads, {share:.0%} in view, {name}"
            rows.append((group, found.total(), found["right"] / found.total(), found["wrong"]))
    yield Table(f"pads of a family, {layers} layers", {"pictures of": TEXT, **COLUMNS}, rows)
    return None


main = Experiment("pad_codes", measure)

if __name__ == "__main__":
    raise SystemExit(main())
