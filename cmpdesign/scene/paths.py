"""Closed polygons of the layout as straight segments in the image, finer where the surface curves them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import SceneError

Points = NDArray[np.float64]

CHORD_PX = 0.0004
MAX_PIECES = 1 << 14


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of closed polygons in the image frame.

    Attributes:
        xy_px: (N, 4) float64: x0, y0, x1, y1.
        owner: (N,) int64, the polygon that each belongs to, ascending.
    """

    xy_px: NDArray[np.float64]
    owner: NDArray[np.int64]


def join(parts: list[Segments]) -> Segments:
    """All polygons of all parts, renumbered in order."""
    first = np.cumsum([0] + [int(part.owner.max(initial=-1)) + 1 for part in parts[:-1]])
    owner = [part.owner + start for part, start in zip(parts, first, strict=True)]
    return Segments(np.concatenate([part.xy_px for part in parts]), np.concatenate(owner))


def segments(polygons_mm: Points, image_from_layout: Callable[[Points], Points], curved: bool) -> Segments:
    """Map polygons (K, n, 2) mm to the image; ``curved``: straight sides do not stay straight there.

    A curved side is cut into pieces, equal in the layout, until chords are within ``CHORD_PX`` of the curve.
    """
    start = polygons_mm.reshape(-1, 2)
    end = np.roll(polygons_mm, -1, axis=1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(polygons_mm)), polygons_mm.shape[1])
    pieces = _pieces(start, end, image_from_layout) if curved else np.ones(len(start), dtype=np.int64)

    side = np.repeat(np.arange(len(start)), pieces)
    step = np.arange(len(side)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    here = image_from_layout(_between(start[side], end[side], step / pieces[side]))
    # Each piece ends, to the last bit, where the next one of its polygon starts.
    count = np.bincount(owner[side], minlength=len(polygons_mm))
    following = np.arange(1, len(side) + 1)
    last = np.cumsum(count) - 1
    following[last] = last - count + 1
    return Segments(np.concatenate([here, here[following]], axis=1), owner[side])


def _between(start: Points, end: Points, t: NDArray[np.float64]) -> Points:
    return np.asarray(start + t[:, None] * (end - start))


def _pieces(start: Points, end: Points, image_from_layout: Callable[[Points], Points]) -> NDArray[np.int64]:
    """How many pieces each side (N, 2) needs; the chord error falls with their number's square."""
    pieces = np.full(len(start), 4, dtype=np.int64)
    open_sides = np.arange(len(start))
    while len(open_sides):
        error = _chord_error(start[open_sides], end[open_sides], pieces[open_sides], image_from_layout)
        coarse = error > CHORD_PX
        open_sides, error = open_sides[coarse], error[coarse]
        more = np.ceil(pieces[open_sides] * np.sqrt(np.minimum(error / CHORD_PX, 64.0)) * 1.05)
        pieces[open_sides] = more.astype(np.int64)
        if pieces.max(initial=0) > MAX_PIECES:
            raise SceneError(
                "the surface is not smooth: a gridline stays bent however finely it is cut; smooth the map"
            )
    return pieces


def _chord_error(
    start: Points, end: Points, pieces: NDArray[np.int64], image_from_layout: Callable[[Points], Points]
) -> NDArray[np.float64]:
    """(N,) px: the largest distance between a piece's middle and its chord's middle."""
    side = np.repeat(np.arange(len(start)), 2 * pieces + 1)
    step = np.arange(len(side)) - np.repeat(np.cumsum(2 * pieces + 1) - (2 * pieces + 1), 2 * pieces + 1)
    xy = image_from_layout(_between(start[side], end[side], step / (2 * pieces[side])))
    middle = np.flatnonzero(step % 2 == 1)
    bend = np.linalg.norm(xy[middle] - 0.5 * (xy[middle - 1] + xy[middle + 1]), axis=1)
    first = np.cumsum(pieces) - pieces
    return np.asarray(np.maximum.reduceat(bend, first))
