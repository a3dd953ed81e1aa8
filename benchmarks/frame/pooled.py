"""Tables of groups of results: a row is a group, a column is a figure of all results of the group.

A name of an attribute may be that of a part's attribute, as ``score.visible``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.table import TEXT, Table

Figure = Callable[[Sequence[Any]], Any]
Columns = Mapping[str, tuple[str, Figure]]  # heading -> format as in ``Table``, and the figure


def pooled_table(title: str, head: str, columns: Columns, groups: Mapping[str, Sequence[Any]]) -> Table:
    """A row for each group that has results; ``head`` is the heading of the groups' names."""
    rows = [
        (name, *(figure(results) for _, figure in columns.values()))
        for name, results in groups.items()
        if results
    ]
    return Table(title, {head: TEXT} | {name: spec for name, (spec, _) in columns.items()}, rows)


def grouped(results: Sequence[Any], name: str) -> dict[Any, list[Any]]:
    """The results by an attribute, in the order of its first values."""
    found: dict[Any, list[Any]] = {}
    for result in results:
        found.setdefault(attrgetter(name)(result), []).append(result)
    return found


def total(name: str) -> Figure:
    """The sum of an attribute."""
    return lambda results: sum(map(attrgetter(name), results))


def share(name: str, of: str) -> Figure:
    """The sum of one attribute over that of another; None where that is 0."""
    return lambda results: total(name)(results) / total(of)(results) if total(of)(results) else None


def percentile(name: str, percent: float) -> Figure:
    """A percentile of the finite values of an attribute; NaN without any."""

    def figure(results: Sequence[Any]) -> float:
        values = np.array([attrgetter(name)(result) for result in results], dtype=np.float64)
        known = values[np.isfinite(values)]
        return float(np.percentile(known, percent)) if len(known) else float("nan")

    return figure


def mean(name: str) -> Figure:
    """The mean of an attribute."""
    return lambda results: float(np.mean([attrgetter(name)(result) for result in results]))


def joined(results: Sequence[Any], name: str) -> NDArray[Any]:
    """The arrays of an attribute one after another."""
    return np.concatenate([attrgetter(name)(result) for result in results])


def rms_of(values: Any) -> float:
    """The root of the mean square of the known values of an array; NaN without any."""
    squares = np.square(np.asarray(values, dtype=np.float64))
    known = squares[~np.isnan(squares)]
    return float(np.sqrt(known.mean())) if len(known) else float("nan")


def counted(words: Iterable[str]) -> str:
    """The words that are not empty, with their numbers."""
    counts = Counter(word for word in words if word)
    return ", ".join(f"{word} {count}" for word, count in sorted(counts.items()))


def reasons(results: Sequence[Any]) -> str:
    """The reasons of results that have one, with their numbers."""
    return counted(result.reason for result in results)
