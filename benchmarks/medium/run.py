"""Depth through a window and a gel: with true constants, with wrong constants, and with air assumed.

    python -m benchmarks.medium [--quick] [--seed N] [--json FILE]

Every rig is drawn at random: two views behind the pattern, 25 to 60 mm away and 15 to 22 degrees to either side, 2 to 5
mm of gel, a window of 2 to 3 mm of acrylic or glass. The pattern fills the same share of the image in all of them. A
ball is pressed in by 0.3 to 1 mm and sheared by up to 0.2 mm. Images are rendered through the medium and read; poses
come from a separate rest frame, so that a wrong constant acts on both. Depth errors are those of the displacement
along z, over the markers that move by more than half of the press. "mean error" is the mean of their absolute values,
"bias" their absolute mean, both per frame; "short" is the share by which the measured displacement is too small, by
least squares; z is the RMS of the errors of positions and of displacements over their covariances. A wrong constant is
taken with both signs. The window that is tilted by 1 degree is tilted in the images, and parallel to the pattern for
the reader.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy

import cv2
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from benchmarks.suites.medium.errors import ROWS, TRUE, DepthErrors, PooledErrors, measure_rig, pool
from benchmarks.suites.medium.rigs import PRESSES_MM, random_rig
from benchmarks.support.machine import conditions_text, write_json

RIGS, QUICK_RIGS = 24, 2


def true_table(pools: list[PooledErrors]) -> Table:
    table = Table(box=SIMPLE_HEAD, title="with the true constants")
    for heading in (
        "press",
        "frames",
        "mean error um",
        "limit um",
        "bias um",
        "z position",
        "z displacement",
    ):
        table.add_column(heading, justify="right")
    for each in pools:
        table.add_row(
            each.label, str(each.frames), f"{each.mean_um:.2f}", f"{each.limit_um:.2f}", f"{each.bias_um:.2f}",
            f"{each.z_position:.2f}", f"{each.z_displacement:.2f}",
        )  # fmt: skip
    return table


def wrong_table(pools: list[PooledErrors]) -> Table:
    table = Table(box=SIMPLE_HEAD, title="what the reader assumes")
    for heading in (
        "assumption", "mean error um", "bias um", "short %", "least", "most", "z position", "z displacement",
        "misfit at rest", "warned %",
    ):  # fmt: skip
        table.add_column(heading, justify="left" if heading == "assumption" else "right")
    for each in pools:
        table.add_row(
            each.label, f"{each.mean_um:.2f}", f"{each.bias_um:.2f}", f"{each.short_percent:.2f}",
            *(f"{v:.2f}" for v in each.short_range_percent), f"{each.z_position:.2f}", f"{each.z_displacement:.2f}",
            f"{each.misfit:.2f}", f"{each.warned_percent:.0f}",
        )  # fmt: skip
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_RIGS} rigs instead of {RIGS}")
    parser.add_argument("--seed", type=int, default=0, help="of the first rig [default: 0]")
    parser.add_argument("--json", type=Path, help="also write the results here")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    errors: list[DepthErrors] = []
    for number in range(QUICK_RIGS if options.quick else RIGS):
        rng = np.random.default_rng([options.seed, number])
        errors += measure_rig(random_rig(rng), rng)
    true = [each for each in errors if each.row == TRUE]
    by_press = [
        pool(f"{low:g} to {high:g} mm", [each for each in true if low <= each.press_mm <= high])
        for low, high in PRESSES_MM
    ]
    by_press.append(pool("all", true))
    by_row = [pool(row, [each for each in errors if each.row == row]) for row in ROWS]
    console = Console(width=150)
    console.print(true_table(by_press))
    console.print(wrong_table(by_row))
    console.print(conditions_text())
    if options.json:
        keys = PooledErrors.__dataclass_fields__
        rows = [{key: getattr(each, key) for key in keys} for each in (*by_press, *by_row)]
        write_json(options.json, {"results": rows})
