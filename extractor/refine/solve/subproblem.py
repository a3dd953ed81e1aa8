"""Some gridlines and the markers at their ends, as if there were no others: for use inside compiled loops."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled


@compiled
def gridlines_at(which, edges):  # type: ignore[no-untyped-def]
    """The gridlines with an end at one of ``gridlines`` (M,) bool."""
    out, count = np.empty(len(edges), np.int64), 0
    for e in range(len(edges)):
        out[count] = e
        count += which[edges[e, 0]] or which[edges[e, 1]]
    return out[:count]


@compiled
def number_subproblem(which, edges, spokes):  # type: ignore[no-untyped-def]
    """The markers at the ends of the gridlines ``gridlines`` (n,), as if there were no others: their numbers (m,),
    these
    gridlines' ends among them, and the gridlines around each among these, -1 for those that are not."""
    number, place = np.full(len(spokes), -1, np.int32), np.full(len(edges), -1, np.int32)
    markers, ends, count = np.empty(len(spokes), np.int64), np.empty((len(which), 2), np.int32), 0
    for k in range(len(which)):
        place[which[k]] = k
        for side in range(2):
            m = edges[which[k], side]
            if number[m] < 0:
                number[m], markers[count] = count, m
                count += 1
            ends[k, side] = number[m]
    around = np.full((count, spokes.shape[1]), -1, np.int32)
    for k in range(count):
        for i in range(spokes.shape[1]):
            e = spokes[markers[k], i]
            around[k, i] = place[e] if e >= 0 else -1
    return markers[:count], ends, around


@compiled
def selected_rows(table, which):  # type: ignore[no-untyped-def]
    """Some rows of a table of two dimensions."""
    out = np.empty((len(which), table.shape[1]), table.dtype)
    for i in range(len(which)):
        for k in range(table.shape[1]):
            out[i, k] = table[which[i], k]
    return out


@compiled
def replaced_table_rows(table, which, rows):  # type: ignore[no-untyped-def]
    """A table of two dimensions with other rows at these numbers (n,)."""
    out = table.copy()
    for i in range(len(which)):
        for k in range(table.shape[1]):
            out[which[i], k] = rows[i, k]
    return out
