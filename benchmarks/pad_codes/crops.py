"""Drawn crops of coded pads with covered spots and scratches, read beside the same crops of plain pads.

The crops of ``benchmarks.views``: the reference cell is covered or outside the picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, islice
from typing import NamedTuple

from benchmarks.frame.parallel import results_of
from benchmarks.frame.pooled import Columns, mean, pooled_table
from benchmarks.frame.table import Table
from benchmarks.suites.views.views import DAMAGED, DrawnView, ViewResult, read_view

CODE, PITCH_PX = 7, (24.0, 76.0)
MIN_BLACK_CELLS = 60
GROUPS = {"60 to 119 black cells": (60, 120), "120 and more": (120, 10**6)}
COLUMNS: Columns = {
    "crops": ("d", len),
    "numbered": (".1%", mean("coded.is_read")),
    "wrong ids": ("d", lambda pairs: sum(pair.coded.wrong_ids > 0 for pair in pairs)),
    "plain numbered": (".1%", mean("plain.is_read")),
    "plain wrong ids": ("d", lambda pairs: sum(pair.plain.wrong_ids > 0 for pair in pairs)),
}


class CropPair(NamedTuple):
    """A crop of a coded pad, and of the plain one."""

    coded: ViewResult
    plain: ViewResult


def both_read(number_of_seed: tuple[int, int]) -> CropPair:
    """A crop by its number and the seed."""
    number, seed = number_of_seed
    return CropPair(*(read_view(DrawnView(DAMAGED, seed, number, code, PITCH_PX)) for code in (CODE, 0)))


def read_crops(crops: int, seed: int, processes: int) -> Iterator[CropPair]:
    """The first crops of a seed with enough black cells wholly in view."""
    numbers = count()
    while crops > 0:
        some = [(number, seed) for number in islice(numbers, 2 * crops)]
        for pair in results_of(both_read, some, processes):
            if pair.coded.seen.black_cells >= MIN_BLACK_CELLS and crops > 0:
                crops -= 1
                yield pair


def crops_table(crops: int, seed: int, processes: int) -> Table:
    """A row for each group of crops by the black cells in view."""
    read = list(read_crops(crops, seed, processes))
    groups = {
        group: [pair for pair in read if low <= pair.coded.seen.black_cells < high]
        for group, (low, high) in GROUPS.items()
    }
    return pooled_table("crops of pads of 5 to 11 layers", "in view", COLUMNS, groups)
