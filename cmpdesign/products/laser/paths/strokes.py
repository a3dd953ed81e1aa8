"""Strokes: what the beam runs along, as one ragged array, so that ten thousand cells cost what one costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import Points

# Tenths of a micrometre: finer than any machine steps, and the same digits in every file.
DECIMALS = 4


@dataclass(frozen=True, eq=False)
class Strokes:
    """Lines of the beam's centre, in burning order.

    Attributes:
        xy_mm: (P, 2) all points, rounded to ``DECIMALS``.
        first: (S + 1,) int64, where each stroke's points begin; the last entry is P.
        owner: (S,) int64, what each stroke belongs to (a cavity's place in its pass).
        closed: they return to their first point, which is not repeated.
    """

    xy_mm: Points
    first: NDArray[np.int64]
    owner: NDArray[np.int64]
    closed: bool

    def __len__(self) -> int:
        return len(self.owner)

    def __iter__(self) -> Iterator[Points]:
        for start, end in zip(self.first[:-1].tolist(), self.first[1:].tolist(), strict=True):
            yield self.xy_mm[start:end]

    def taken(self, which: NDArray[np.int64]) -> Strokes:
        """Some of them, in the order of ``which``."""
        counts = np.diff(self.first)[which]
        first = np.concatenate([[0], np.cumsum(counts)])
        points = np.repeat(self.first[which] - first[:-1], counts) + np.arange(first[-1])
        return Strokes(self.xy_mm[points], first, self.owner[which], self.closed)

    def opened(self) -> Strokes:
        """The same lines, those of closed ones with their first point repeated at the end."""
        if not self.closed:
            return self
        first = self.first + np.arange(len(self.first))
        points = np.insert(np.arange(len(self.xy_mm)), self.first[1:], self.first[:-1])
        return Strokes(self.xy_mm[points], first, self.owner, False)

    def moved(self, by_mm: Points) -> Strokes:
        """All of them shifted; by_mm: (2,)."""
        return Strokes(round_points(self.xy_mm + by_mm), self.first, self.owner, self.closed)


def loop_strokes(paths_mm: Points, owner: NDArray[np.int64]) -> Strokes:
    """(N, K, 2) closed paths as strokes."""
    count, corners = paths_mm.shape[:2]
    return Strokes(round_points(paths_mm.reshape(-1, 2)), corners * np.arange(count + 1), owner, closed=True)


def ragged_strokes(paths_mm: Sequence[Points], owner: Sequence[int], closed: bool) -> Strokes:
    """Paths of different lengths as strokes."""
    first = np.cumsum([0, *(len(path) for path in paths_mm)])
    points = np.concatenate([*paths_mm, np.empty((0, 2))])
    return Strokes(round_points(points), first, np.array(owner, dtype=np.int64), closed)


def join_strokes(parts: Sequence[Strokes]) -> Strokes:
    """Several sets of open strokes as one, those of the same owner together, in the order of the parts."""
    first = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(part.first) for part in parts]))])
    owner = np.concatenate([part.owner for part in parts])
    together = Strokes(np.concatenate([part.xy_mm for part in parts]), first, owner, False)
    return together.taken(np.argsort(owner, kind="stable"))


def round_points(xy_mm: Points) -> Points:
    """To ``DECIMALS`` places, without negative zeros."""
    return np.asarray(np.round(xy_mm, DECIMALS) + 0.0)
