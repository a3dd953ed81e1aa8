"""A stronger reader of the square pattern than the article's: corners lost by contours are found as saddle points.

Where four squares meet, brightness has a saddle point, even when the squares are joined by blur. The lattice is grown
from the corners found by contours: further corners are searched at positions predicted from their neighbours. Results
are reported in addition to the former method's.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluation.square.contour_reader import Gray, SquareReader, gray_light, refine_corners
from cmpdesign.libraries import extra

Points = NDArray[np.float64]
SMOOTHING_EDGES = 0.08  # sigma of the Gaussian before the second derivatives, in edges
MIN_RESPONSE_SHARE = 0.02  # share of the strong saddles' response below which a maximum is noise
SEARCH_REACH_EDGES = 0.3  # largest distance of a corner from its predicted position, in edges


class LatticePlace(NamedTuple):
    """A corner of the square lattice, or the difference of two corners."""

    row: int
    column: int


class _Candidate(NamedTuple):
    """A saddle point near the predicted position of a corner, ordered by distance."""

    distance_edges: float
    place: LatticePlace
    saddle: int


RIGHT, DOWN = LatticePlace(0, 1), LatticePlace(1, 0)
NEIGHBOUR_OFFSETS = (RIGHT, DOWN, LatticePlace(0, -1), LatticePlace(-1, 0))


@dataclass(frozen=True, eq=False)
class SaddleReader(SquareReader):
    """Reads one view of a square pattern by contours, then by saddle points."""

    def read(self, bgr: NDArray[np.uint8]) -> Points:
        """(M, 2) the markers' positions in px, NaN where lost. A poor image never raises an exception."""
        xy_px = super().read(bgr)
        known = np.flatnonzero(np.isfinite(xy_px[:, 0])).tolist()
        if not known or len(known) == len(xy_px):
            return xy_px
        side = int(self.layout.marker_index.max()) + 1
        start = {LatticePlace(*divmod(marker, side)): xy_px[marker] for marker in known}
        gray = gray_light(bgr, self.response)
        placed = grow_lattice(find_saddles(gray, self.edge_px), start, side, self.edge_px * self.axes_px)
        more = sorted(placed.keys() - start.keys())
        if more:
            ids = [place.row * side + place.column for place in more]
            xy_px[ids] = refine_corners(gray, np.array([placed[place] for place in more]), self.edge_px)
        return xy_px


@dataclass(frozen=True, eq=False)
class SaddlePoints:
    """Saddle points: (N, 2) positions in px, and (N, 2, 2) the second derivatives of brightness."""

    xy_px: Points
    hessian: Points


def find_saddles(gray: Gray, edge_px: float) -> SaddlePoints:
    """The strong local maxima of the negative Hessian determinant of the smoothed brightness."""
    import cv2

    smooth = cv2.GaussianBlur(gray, (0, 0), max(SMOOTHING_EDGES * edge_px, 1.0))
    xx, yy, xy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1)))
    response = xy * xy - xx * yy
    reach = max(round(0.2 * edge_px), 2)
    highest = cv2.dilate(response, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    peaks = response[(response == highest) & (response > 0)]
    strong = float(np.quantile(peaks, 0.9)) if len(peaks) else 1.0
    rows, columns = np.nonzero((response == highest) & (response > MIN_RESPONSE_SHARE * strong))
    hessian = np.stack([xx, xy, xy, yy], axis=-1)[rows, columns].reshape(-1, 2, 2).astype(np.float64)
    return SaddlePoints(np.stack([columns, rows], axis=1).astype(np.float64), hessian)


def grow_lattice(
    saddles: SaddlePoints, start: dict[LatticePlace, Points], side: int, cell: Points
) -> dict[LatticePlace, Points]:
    """Positions in px by place: ``start``, and the corners found outward from it.

    The nearest saddle point within ``SEARCH_REACH_EDGES`` of a neighbour's predicted position is used, the nearest
    first, each once. The sign of its second derivatives must fit the place: light and dark cells alternate, and the top
    left cell of the pattern is light.

    Args:
        saddles: the saddle points.
        start: (2,) px of known corners.
        side: corners along a side of the pattern.
        cell: (2, 2) px, the default offsets to the next column and to the next row.
    """
    with extra("evaluate"):
        from scipy.spatial import cKDTree

    if not len(saddles.xy_px):
        return start
    tree = cKDTree(saddles.xy_px)
    placed = dict(start)
    used: set[int] = set()
    queue: list[_Candidate] = []

    def add_neighbours(known: LatticePlace) -> None:
        right_px, down_px = (_predict_offset(known, step, placed, cell) for step in (RIGHT, DOWN))
        edge_px = float(min(np.linalg.norm(right_px), np.linalg.norm(down_px)))
        for step in NEIGHBOUR_OFFSETS:
            neighbour = LatticePlace(known.row + step.row, known.column + step.column)
            if neighbour in placed or min(neighbour) < 0 or max(neighbour) >= side:
                continue
            predicted = placed[known] + _predict_offset(known, step, placed, cell)
            distance, saddle = tree.query(predicted, distance_upper_bound=SEARCH_REACH_EDGES * edge_px)
            if not np.isfinite(distance):
                continue
            light_below = bool(right_px @ saddles.hessian[saddle] @ down_px > 0)
            if light_below == (sum(neighbour) % 2 == 0):
                heappush(queue, _Candidate(float(distance) / edge_px, neighbour, int(saddle)))

    for place, xy in start.items():
        distance, saddle = tree.query(xy)
        if distance <= SMOOTHING_EDGES * float(np.linalg.norm(cell[0])) + 1:
            used.add(int(saddle))
        add_neighbours(place)
    while queue:
        candidate = heappop(queue)
        if candidate.place not in placed and candidate.saddle not in used:
            placed[candidate.place] = saddles.xy_px[candidate.saddle]
            used.add(candidate.saddle)
            add_neighbours(candidate.place)
    return placed


def _predict_offset(
    place: LatticePlace, step: LatticePlace, placed: dict[LatticePlace, Points], cell: Points
) -> Points:
    """(2,) px: the offset to a neighbour, the mean of known parallel offsets around ``place``, or the default."""
    pairs = [(LatticePlace(place.row - step.row, place.column - step.column), place)]
    for side in (-1, 1):
        begin = LatticePlace(place.row + side * step.column, place.column + side * step.row)
        pairs.append((begin, LatticePlace(begin.row + step.row, begin.column + step.column)))
    known = [placed[end] - placed[begin] for begin, end in pairs if begin in placed and end in placed]
    return np.asarray(np.mean(known, axis=0) if known else step.column * cell[0] + step.row * cell[1])
