"""Parts of coded pads that are cropped and damaged, registered by their cells and bits: right and wrong motions."""

from __future__ import annotations

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.pad_codes.parts import measured


def measure(layers: int = 10, parts: int = 100_000, seed: int = 5) -> Shown:
    """One row for every group of parts."""
    counts, median_ms = measured(layers, parts, seed)
    rows = [
        (group, found.total(), found["right"] / found.total(), found["wrong"])
        for group, found in sorted(counts.items())
    ]
    columns = {"bits": TEXT, "parts": "d", "right": ".2%", "wrong": "d"}
    yield Table(f"{layers} layers, {parts} parts; median {median_ms:.2f} ms a part", columns, rows)


main = Experiment("pad_codes", measure)

if __name__ == "__main__":
    raise SystemExit(main())
