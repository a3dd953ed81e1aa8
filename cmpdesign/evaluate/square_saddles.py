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
        placed = grow(saddles, dict(zip(ids, first, strict=True)), side, self.axes_px * self.edge_px)
        if placed:
            found = np.array(sorted(placed), dtype=np.int64)
            xy_px[found] = refined(bgr, np.array([placed[i] for i in found.tolist()]), self.edge_px)
        return xy_px


def find_saddles(bgr: NDArray[np.uint8], edge_px: float) -> Points:
    """(N, 2) the strong local maxima of the negative Hessian determinant of the smoothed brightness, in px."""
    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(gray, (0, 0), max(SMOOTH * edge_px, 1.0))
    xx, yy, xy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1)))
    response = xy * xy - xx * yy
    reach = max(round(0.2 * edge_px), 2)
    highest = cv2.dilate(response, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    strong = float(np.quantile(response[(response == highest) & (response > 0)], 0.9))
    rows, columns = np.nonzero((response == highest) & (response > WEAK * strong))
    return np.stack([columns, rows], axis=1).astype(np.float64)


def grow(saddles: Points, start: dict[int, Points], side: int, steps_px: Points) -> dict[int, Points]:
    """Marker id -> place, outward from the places ``start`` of the reference cell's markers.

    The nearest saddle within ``REACH`` of where a neighbour is expected is taken, the best fitting first, each once.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(saddles)
    placed: dict[Place, Points] = {}
    used: set[int] = set()
    queue: list[tuple[float, Place, int]] = []

    def offer(place: Place, expected: Points, step_px: float) -> None:
        apart, saddle = tree.query(expected, distance_upper_bound=REACH * step_px)
        if np.isfinite(apart):
            heappush(queue, (float(apart) / step_px, place, int(saddle)))

    for marker, xy in start.items():
        offer(divmod(marker, side), xy, float(np.linalg.norm(steps_px[0])))
    while queue:
        _, place, saddle = heappop(queue)
        if place in placed or saddle in used:
            continue
        placed[place] = saddles[saddle]
        used.add(saddle)
        if len(placed) < len(start):
            continue
        for down, right in STEPS:
            near = place[0] + down, place[1] + right
            if near not in placed and min(near) >= 0 and max(near) < side:
                step = _step(place, (down, right), placed, steps_px)
                offer(near, placed[place] + step, float(np.linalg.norm(step)))
    return {row * side + column: xy for (row, column), xy in placed.items()}


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
