"""A subproblem: some gridlines and the markers at their ends, numbered as if there were no others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled


class SubproblemNumbering(NamedTuple):
    """The markers of n gridlines, numbered among themselves.

    Attributes:
        markers: (m,) the markers at the gridlines' ends.
        ends: (n, 2) places of each gridline's ends in ``markers``.
        spokes: (m, 6) places of the gridlines at each marker among the n, -1 for none.
    """

    markers: NDArray[np.int64]
    ends: NDArray[np.int32]
    spokes: NDArray[np.int32]


@compiled
def gridlines_at(selected, edges):  # type: ignore[no-untyped-def]
    """(n,) the gridlines with an end at a selected marker (M,) bool."""
    out, count = np.empty(len(edges), np.int64), 0
    for e in range(len(edges)):
        out[count] = e
        count += selected[edges[e, 0]] or selected[edges[e, 1]]
    return out[:count]


@compiled
def number_subproblem(gridlines, edges, spokes):  # type: ignore[no-untyped-def]
    """``SubproblemNumbering`` of gridlines (n,); ``edges`` (E, 2) and ``spokes`` (M, 6) as in ``Topology``."""
    number, place = np.full(len(spokes), -1, np.int32), np.full(len(edges), -1, np.int32)
    markers, ends, count = np.empty(len(spokes), np.int64), np.empty((len(gridlines), 2), np.int32), 0
    for k in range(len(gridlines)):
        place[gridlines[k]] = k
        for side in range(2):
            m = edges[gridlines[k], side]
            if number[m] < 0:
                number[m], markers[count] = count, m
                count += 1
            ends[k, side] = number[m]
    around = np.full((count, spokes.shape[1]), -1, np.int32)
    for k in range(count):
        for i in range(spokes.shape[1]):
            e = spokes[markers[k], i]
            around[k, i] = place[e] if e >= 0 else -1
    return SubproblemNumbering(markers[:count], ends, around)


@compiled
def selected_rows(table, numbers):  # type: ignore[no-untyped-def]
    """The rows of a two-dimensional table with these numbers (n,)."""
    out = np.empty((len(numbers), table.shape[1]), table.dtype)
    for i in range(len(numbers)):
        for k in range(table.shape[1]):
            out[i, k] = table[numbers[i], k]
    return out
