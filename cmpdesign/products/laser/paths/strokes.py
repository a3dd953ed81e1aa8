"""Strokes: paths of the beam's centre as one ragged array, so that operations on many cells run in numpy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.products.laser.paths.beam import Points

# Decimals of coordinates in mm: 0.1 micrometre, finer than the steps of machines.
DECIMALS = 4


@dataclass(frozen=True, eq=False)
class Strokes:
    """Lines of the beam's centre, in burning order.

    Attributes:
        xy_mm: (P, 2) points of all strokes, rounded to ``DECIMALS``.
        first: (S + 1,) int64, index of each stroke's first point; the last entry is P.
        owner: (S,) int64, owner of each stroke: the index of a cavity in its pass.
        closed: True if all strokes return to their first point; that point is not repeated.
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

    def selected(self, which: NDArray[np.int64]) -> Strokes:
        """The strokes with the indices ``which``, in that order."""
        counts = np.diff(self.first)[which]
        first = np.concatenate([[0], np.cumsum(counts)])
        points = np.repeat(self.first[which] - first[:-1], counts) + np.arange(first[-1])
        return Strokes(self.xy_mm[points], first, self.owner[which], self.closed)

    def opened(self) -> Strokes:
        """The same lines as open strokes; the first point of a closed stroke is repeated at the end."""
        if not self.closed:
            return self
        first = self.first + np.arange(len(self.first))
        points = np.insert(np.arange(len(self.xy_mm)), self.first[1:], self.first[:-1])
        return Strokes(self.xy_mm[points], first, self.owner, False)

    def moved(self, shift_mm: Points) -> Strokes:
        """All strokes shifted; shift_mm: (2,)."""
        return Strokes(round_points(self.xy_mm + shift_mm), self.first, self.owner, self.closed)


def loop_strokes(paths_mm: Points, owner: NDArray[np.int64]) -> Strokes:
    """Closed strokes of (N, K, 2) paths with (N,) owners."""
    count, corners = paths_mm.shape[:2]
    return Strokes(round_points(paths_mm.reshape(-1, 2)), corners * np.arange(count + 1), owner, closed=True)


def ragged_strokes(paths_mm: Sequence[Points], owner: Sequence[int], closed: bool) -> Strokes:
    """Strokes of (K, 2) paths of different lengths."""
    first = np.cumsum([0, *(len(path) for path in paths_mm)])
    points = np.concatenate([*paths_mm, np.empty((0, 2))])
    return Strokes(round_points(points), first, np.array(owner, dtype=np.int64), closed)


def join_strokes(parts: Sequence[Strokes]) -> Strokes:
    """Join sets of open strokes; strokes of one owner follow each other in the order of the sets."""
    first = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(part.first) for part in parts]))])
    owner = np.concatenate([part.owner for part in parts])
    joined = Strokes(np.concatenate([part.xy_mm for part in parts]), first, owner, False)
    return joined.selected(np.argsort(owner, kind="stable"))


def round_points(xy_mm: Points) -> Points:
    """Round coordinates to ``DECIMALS`` places, without negative zeros."""
    return np.asarray(np.round(xy_mm, DECIMALS) + 0.0)
