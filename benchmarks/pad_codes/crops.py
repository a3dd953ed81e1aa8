"""Drawn crops of coded pads with covered spots and scratches, read beside the same crops of plain pads.

The crops of ``benchmarks.views``: the reference cell is covered or outside the picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, islice
from typing import NamedTuple

from benchmarks.frame.parallel import results_of
from benchmarks.suites.views.views import DAMAGED, DrawnView, ViewResult, read_view

CODE, PITCH_PX = 7, (24.0, 76.0)
MIN_BLACK_CELLS = 60
GROUPS = {"60 to 119 black cells": (60, 120), "120 and more": (120, 10**6)}


class CropCounts(NamedTuple):
    """Crops of one group: coded ones and plain ones that are numbered, and those with a wrong id."""

    crops: int
    coded: int
    coded_wrong: int
    plain: int
    plain_wrong: int


def both_read(number_of_seed: tuple[int, int]) -> tuple[ViewResult, ViewResult]:
    """A crop of a coded pad, and of the plain one."""
    number, seed = number_of_seed
    coded, plain = (read_view(DrawnView(DAMAGED, seed, number, code, PITCH_PX)) for code in (CODE, 0))
    return coded, plain


def read_crops(crops: int, seed: int, processes: int) -> Iterator[tuple[ViewResult, ViewResult]]:
    """The first crops of a seed with enough black cells wholly in view."""
    numbers = count()
    while crops > 0:
        some = [(number, seed) for number in islice(numbers, 2 * crops)]
        for coded, plain in results_of(both_read, some, processes):
            if coded.black_cells >= MIN_BLACK_CELLS and crops > 0:
                crops -= 1
                yield coded, plain


def counted(read: list[tuple[ViewResult, ViewResult]]) -> dict[str, CropCounts]:
    """The counts by group."""
    found = {}
    for group, (low, high) in GROUPS.items():
        pairs = [pair for pair in read if low <= pair[0].black_cells < high]
        figures = [
            value
            for side in (0, 1)
            for value in (
                sum(pair[side].reported > 0 for pair in pairs),
                sum(pair[side].wrong_ids > 0 for pair in pairs),
            )
        ]
        found[group] = CropCounts(len(pairs), *figures)
    return found
