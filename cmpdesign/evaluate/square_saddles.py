"""A stronger reader of the square pattern than its users had: corners as saddle points of the brightness.

Where four squares meet, brightness has a saddle, and it keeps it when the squares stick. So corners are found one by
one, without contours, and the lattice is grown from the reference cell: the next corner is looked for where its
neighbours let it be expected. Stated beside the former method, never instead of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate.square import SquareReader, reference_ids, refined
from cmpdesign.evaluate.square_quads import find_quads

Points = NDArray[np.float64]
Place = tuple[int, int]  # row, column
SMOOTH = 0.08  # sigma of the Gaussian before the second derivatives, in edges
WEAK = 0.02  # share of the strong saddles' response below which a maximum is noise
REACH = 0.3  # how far from where it is expected a corner may lie, in edges
STEPS = ((0, 1), (1, 0), (0, -1), (-1, 0))


@dataclass(frozen=True, eq=False)
class SaddleReader(SquareReader):
    """Reads one view of a square pattern by its saddle points."""

    def read(self, bgr: NDArray[np.uint8]) -> Points:
        """(M, 2) the markers' places in px, NaN where lost. A poor image is data, never an exception."""
        xy_px = np.full((len(self.layout.marker_xy_mm), 2), np.nan)
        quads = find_quads(bgr, self.edge_px)
        if quads.reference is None:
            return xy_px
        side = int(self.layout.marker_index.max()) + 1
        first = quads.corners_px[quads.reference]
        ids = reference_ids(first, self.axes_px, int(self.layout.reference_marker), side)
        saddles = find_saddles(bgr, self.edge_px)
        start = {divmod(marker, side): place for marker, place in zip(ids, first, strict=True)}
        placed = grow(saddles, start, side, self.axes_px * self.edge_px)
        if placed:
            found = np.array([row * side + column for row, column in sorted(placed)], dtype=np.int64)
            places = np.array([placed[place] for place in sorted(placed)])
            xy_px[found] = refined(bgr, places, self.edge_px)
        return xy_px


@dataclass(frozen=True, eq=False)
class Saddles:
    """Saddle points: (N, 2) their places in px, and (N, 2, 2) the second derivatives there."""

    xy_px: Points
    bend: Points


def find_saddles(bgr: NDArray[np.uint8], edge_px: float) -> Saddles:
    """The strong local maxima of the negative Hessian determinant of the smoothed brightness."""
    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(gray, (0, 0), max(SMOOTH * edge_px, 1.0))
    xx, yy, xy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1)))
    response = xy * xy - xx * yy
    reach = max(round(0.2 * edge_px), 2)
    highest = cv2.dilate(response, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    strong = float(np.quantile(response[(response == highest) & (response > 0)], 0.9))
    rows, columns = np.nonzero((response == highest) & (response > WEAK * strong))
    bend = np.stack([xx, xy, xy, yy], axis=-1)[rows, columns].reshape(-1, 2, 2).astype(np.float64)
    return Saddles(np.stack([columns, rows], axis=1).astype(np.float64), bend)


def grow(saddles: Saddles, start: dict[Place, Points], side: int, steps_px: Points) -> dict[Place, Points]:
    """(row, column) -> place, outward from the places ``start`` of the reference cell's markers.

    The nearest saddle within ``REACH`` of where a neighbour is expected is taken, the best fitting first, each once.
    It must bend as its place in the lattice says: light and dark cells alternate.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(saddles.xy_px)
    turn = np.sign(steps_px[0, 0] * steps_px[1, 1] - steps_px[0, 1] * steps_px[1, 0])
    top_left = min(start)
    placed: dict[Place, Points] = {}
    used: set[int] = set()
    queue: list[tuple[float, Place, int]] = []

    def offer(place: Place, expected: Points, across: Points) -> None:
        step_px = float(np.linalg.norm(across))
        apart, saddle = tree.query(expected, distance_upper_bound=REACH * step_px)
        if not np.isfinite(apart):
            return
        down = turn * np.array([-across[1], across[0]])
        light_below = across @ saddles.bend[saddle] @ down > 0
        if light_below == ((sum(place) - sum(top_left)) % 2 == 0):
            heappush(queue, (float(apart) / step_px, place, int(saddle)))

    right_px = start[top_left[0], top_left[1] + 1] - start[top_left]
    for place, xy in start.items():
        offer(place, xy, right_px)
    while queue:
        _, place, saddle = heappop(queue)
        if place in placed or saddle in used:
            continue
        placed[place] = saddles.xy_px[saddle]
        used.add(saddle)
        if len(placed) < len(start):
            continue
        # The start's markers wait for each other, since their steps tell how the cell is turned.
        for known in placed if len(placed) == len(start) else (place,):
            for down, right in STEPS:
                near = known[0] + down, known[1] + right
                if near not in placed and min(near) >= 0 and max(near) < side:
                    step = _step(known, (down, right), placed, steps_px)
                    across = step if right else turn * np.array([step[1], -step[0]])
                    offer(near, placed[known] + step, (down + right) * across)
    return placed


def _step(place: Place, way: Place, placed: dict[Place, Points], steps_px: Points) -> Points:
    """The step to a neighbour: the mean of the step behind and those beside, or as it is at rest."""
    (row, column), (down, right) = place, way
    pairs = [((row - down, column - right), place)]
    pairs += [
        ((row + i * right, column + i * down), (row + i * right + down, column + i * down + right))
        for i in (-1, 1)
    ]
    known = [placed[end] - placed[begin] for begin, end in pairs if begin in placed and end in placed]
    return np.asarray(np.mean(known, axis=0) if known else down * steps_px[1] + right * steps_px[0])
