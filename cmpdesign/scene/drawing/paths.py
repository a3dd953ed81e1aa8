"""Closed polygons of the layout as straight segments in the image, subdivided where the surface curves them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.scene.errors import SceneError

Points = NDArray[np.float64]

CHORD_PX = 0.0004  # largest distance between a chord and its curve
MAX_SIDE_PIECES = 1 << 14


@dataclass(frozen=True, eq=False)
class PolygonSegments:
    """Segments of closed polygons in the image frame.

    Attributes:
        xy_px: (N, 4) float64: x0, y0, x1, y1.
        owner: (N,) int64, the polygon of each segment, ascending.
    """

    xy_px: NDArray[np.float64]
    owner: NDArray[np.int64]


def join_segments(parts: list[PolygonSegments]) -> PolygonSegments:
    """All polygons of all parts, numbered consecutively."""
    first = np.cumsum([0] + [int(part.owner.max(initial=-1)) + 1 for part in parts[:-1]])
    owner = [part.owner + start for part, start in zip(parts, first, strict=True)]
    return PolygonSegments(np.concatenate([part.xy_px for part in parts]), np.concatenate(owner))


def project_polygons(
    polygons_mm: Points, image_from_layout: Callable[[Points], Points], curved: bool
) -> PolygonSegments:
    """Map polygons (K, n, 2) mm to the image.

    Args:
        polygons_mm: closed polygons, the first point not repeated.
        image_from_layout: (N, 2) mm to (N, 2) px.
        curved: straight sides become curves. They are divided into pieces, equal in the layout, until the distance
            between chords and curve is below ``CHORD_PX``.
    """
    start = polygons_mm.reshape(-1, 2)
    end = np.roll(polygons_mm, -1, axis=1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(polygons_mm)), polygons_mm.shape[1])
    if curved:
        starts, pieces = _project_sides(start, end, image_from_layout)
    else:
        starts, pieces = image_from_layout(start), np.ones(len(start), dtype=np.int64)
    # Each piece ends exactly at the start of the next piece of its polygon.
    count = np.bincount(owner, pieces, minlength=len(polygons_mm)).astype(np.int64)
    next_start = np.arange(1, len(starts) + 1)
    last = np.cumsum(count) - 1
    next_start[last] = last - count + 1
    return PolygonSegments(np.concatenate([starts, starts[next_start]], axis=1), np.repeat(owner, pieces))


def _project_sides(
    start: Points, end: Points, image_from_layout: Callable[[Points], Points]
) -> tuple[Points, NDArray[np.int64]]:
    """The start points of the pieces of all sides (N, 2) in order, and (N,) the number of each side's pieces.

    Pieces of half the length have a fourth of the chord error, so the error is estimated from the middles.
    """
    pieces = np.full(len(start), 4, dtype=np.int64)
    rounds = []
    open_sides = np.arange(len(start))
    while len(open_sides):
        xy, first = _project_pieces(start[open_sides], end[open_sides], pieces[open_sides], image_from_layout)
        error = _chord_error(xy, first, pieces[open_sides]) / 4
        coarse = error > CHORD_PX
        rounds.append((open_sides[~coarse], first[~coarse], xy))
        open_sides, error = open_sides[coarse], error[coarse]
        more = np.ceil(pieces[open_sides] * np.sqrt(np.minimum(error / CHORD_PX, 64.0)) * 1.05)
        pieces[open_sides] = more.astype(np.int64)
        if pieces.max(initial=0) > MAX_SIDE_PIECES:
            raise SceneError(
                "the surface is not smooth: a gridline is bent at every subdivision; smooth the map"
            )
    pieces *= 2
    starts = np.empty((int(pieces.sum()), 2))
    offset = np.cumsum(pieces) - pieces
    for sides, first, xy in rounds:
        starts[_concatenated_ranges(offset[sides], pieces[sides])] = xy[
            _concatenated_ranges(first, pieces[sides])
        ]
    return starts, pieces


def _project_pieces(
    start: Points, end: Points, pieces: NDArray[np.int64], image_from_layout: Callable[[Points], Points]
) -> tuple[Points, NDArray[np.int64]]:
    """The ends and middles of every side's pieces in px, and the index of each side's first point."""
    count = 2 * pieces + 1
    first = np.cumsum(count) - count
    side = np.repeat(np.arange(len(start)), count)
    number = np.arange(len(side)) - first[side]
    t = (number / (2 * pieces[side]))[:, None]
    return image_from_layout(start[side] + t * (end - start)[side]), first


def _chord_error(xy: Points, first: NDArray[np.int64], pieces: NDArray[np.int64]) -> NDArray[np.float64]:
    """(N,) px: the largest distance of each side between a piece's middle and its chord's middle."""
    middle = np.repeat(first, pieces) + 2 * _concatenated_ranges(np.zeros_like(pieces), pieces) + 1
    bend = np.linalg.norm(xy[middle] - 0.5 * (xy[middle - 1] + xy[middle + 1]), axis=1)
    return np.asarray(np.maximum.reduceat(bend, np.cumsum(pieces) - pieces))


def _concatenated_ranges(first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """The ranges first, first + 1, ... of ``count`` numbers, one after the other."""
    before = np.cumsum(count) - count
    return np.asarray(np.arange(int(count.sum())) + np.repeat(first - before, count))
