"""A stronger reader of the square pattern than its users had: what contours lose is sought as saddle points.

Where four squares meet, brightness has a saddle, and it keeps it when the squares stick. So from the corners that
contours gave, the lattice is grown to those they did not: the next corner is looked for where its neighbours let it be
expected. Stated beside the former method, never instead of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate.square.contour_reader import SquareReader, refine_corners

Points = NDArray[np.float64]
LatticePlace = tuple[int, int]  # row, column
SMOOTHING_EDGES = 0.08  # sigma of the Gaussian before the second derivatives, in edges
MIN_RESPONSE_SHARE = 0.02  # share of the strong saddles' response below which a maximum is noise
SEARCH_REACH_EDGES = 0.3  # how far from where it is expected a corner may lie, in edges
NEIGHBOUR_OFFSETS = ((0, 1), (1, 0), (0, -1), (-1, 0))


@dataclass(frozen=True, eq=False)
class SaddleReader(SquareReader):
    """Reads one view of a square pattern by contours, and then by saddle points."""

    def read(self, bgr: NDArray[np.uint8]) -> Points:
        """(M, 2) the markers' places in px, NaN where lost. A poor image is data, never an exception."""
        xy_px = super().read(bgr)
        known = np.flatnonzero(np.isfinite(xy_px[:, 0])).tolist()
        if not known or len(known) == len(xy_px):
            return xy_px
        side = int(self.layout.marker_index.max()) + 1
        start = {divmod(marker, side): xy_px[marker] for marker in known}
        placed = grow_lattice(find_saddles(bgr, self.edge_px), start, side, self.edge_px * self.axes_px)
        more = sorted(placed.keys() - start.keys())
        if more:
            ids = [row * side + column for row, column in more]
            xy_px[ids] = refine_corners(bgr, np.array([placed[place] for place in more]), self.edge_px)
        return xy_px


@dataclass(frozen=True, eq=False)
class SaddlePoints:
    """Saddle points: (N, 2) their places in px, and (N, 2, 2) the second derivatives there."""

    xy_px: Points
    bend: Points


def find_saddles(bgr: NDArray[np.uint8], edge_px: float) -> SaddlePoints:
    """The strong local maxima of the negative Hessian determinant of the smoothed brightness."""
    import cv2

    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(gray, (0, 0), max(SMOOTHING_EDGES * edge_px, 1.0))
    xx, yy, xy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1)))
    response = xy * xy - xx * yy
    reach = max(round(0.2 * edge_px), 2)
    highest = cv2.dilate(response, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    peaks = response[(response == highest) & (response > 0)]
    strong = float(np.quantile(peaks, 0.9)) if len(peaks) else 1.0
    rows, columns = np.nonzero((response == highest) & (response > MIN_RESPONSE_SHARE * strong))
    bend = np.stack([xx, xy, xy, yy], axis=-1)[rows, columns].reshape(-1, 2, 2).astype(np.float64)
    return SaddlePoints(np.stack([columns, rows], axis=1).astype(np.float64), bend)


def grow_lattice(
    saddles: SaddlePoints, start: dict[LatticePlace, Points], side: int, cell: Points
) -> dict[LatticePlace, Points]:
    """(row, column) -> place: ``start``, and what is found outward from it.

    The nearest saddle within ``SEARCH_REACH_EDGES`` of where a neighbour is expected is taken, the best fitting
    first, each once.
    It must bend as its place says: light and dark cells alternate, and top left of the pattern is a light one.
    ``cell`` (2, 2) holds the steps from column to column and from row to row where no neighbour tells them.
    """
    from scipy.spatial import cKDTree

    if not len(saddles.xy_px):
        return start
    tree = cKDTree(saddles.xy_px)
    placed = dict(start)
    used: set[int] = set()
    queue: list[tuple[float, LatticePlace, int]] = []

    def offer_neighbours(known: LatticePlace) -> None:
        right_px, down_px = (_predict_offset(known, way, placed, cell) for way in ((0, 1), (1, 0)))
        edge_px = float(min(np.linalg.norm(right_px), np.linalg.norm(down_px)))
        for way in NEIGHBOUR_OFFSETS:
            near = known[0] + way[0], known[1] + way[1]
            if near in placed or min(near) < 0 or max(near) >= side:
                continue
            expected = placed[known] + _predict_offset(known, way, placed, cell)
            apart, saddle = tree.query(expected, distance_upper_bound=SEARCH_REACH_EDGES * edge_px)
            if not np.isfinite(apart):
                continue
            light_below = bool(right_px @ saddles.bend[saddle] @ down_px > 0)
            if light_below == (sum(near) % 2 == 0):
                heappush(queue, (float(apart) / edge_px, near, int(saddle)))

    for place, xy in start.items():
        apart, saddle = tree.query(xy)
        if apart <= SMOOTHING_EDGES * float(np.linalg.norm(cell[0])) + 1:
            used.add(int(saddle))
        offer_neighbours(place)
    while queue:
        _, place, saddle = heappop(queue)
        if place not in placed and saddle not in used:
            placed[place] = saddles.xy_px[saddle]
            used.add(saddle)
            offer_neighbours(place)
    return placed


def _predict_offset(
    place: LatticePlace, way: LatticePlace, placed: dict[LatticePlace, Points], cell: Points
) -> Points:
    """The step to a neighbour: the mean of the step behind and those beside, or as at rest."""
    (row, column), (down, right) = place, way
    pairs = [((row - down, column - right), place)]
    for i in (-1, 1):
        beside = row + i * right, column + i * down
        pairs.append((beside, (beside[0] + down, beside[1] + right)))
    known = [placed[end] - placed[begin] for begin, end in pairs if begin in placed and end in placed]
    return np.asarray(np.mean(known, axis=0) if known else right * cell[0] + down * cell[1])
