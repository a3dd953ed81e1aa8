"""The article's corners: triangles fitted to the contours of the regions grown by AGA, without refinement."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.article.regions import InkRegions

MIN_AREA_PX = 4.0
MIN_FILL = 0.6  # smallest share of a triangle's area that its contour fills ("area, perimeter")


class Triangles(NamedTuple):
    """Triangles of regions.

    Attributes:
        corner_px: (T, 3, 2) float64, clockwise in the image.
        ink: (T,) uint8, 1 red, 2 green, 3 blue.
        region: (T,) int32, the number of the region, from 0.
    """

    corner_px: NDArray[np.float64]
    ink: NDArray[np.uint8]
    region: NDArray[np.int32]


class RegionBoxes(NamedTuple):
    """First and last columns and rows of regions, (count,) px each."""

    left: NDArray[np.intp]
    top: NDArray[np.intp]
    right: NDArray[np.intp]
    bottom: NDArray[np.intp]


def fit_plain_triangles(regions: InkRegions) -> Triangles:
    """The smallest triangle around every region that fills its triangle."""
    corners, kept = [], []
    boxes = _region_boxes(regions.region_map, len(regions.ink))
    for number in range(len(regions.ink)):
        left, top, right, bottom = (int(side[number]) for side in boxes)
        if right < left:
            continue
        low = np.array([left, top])
        part = regions.region_map[top : bottom + 1, left : right + 1]
        contour = _largest_contour((part == number + 1).astype(np.uint8))
        area, corner = cv2.minEnclosingTriangle(contour)
        if corner is None or area < MIN_AREA_PX or cv2.contourArea(contour) < MIN_FILL * area:
            continue
        corners.append(_order_clockwise(corner.reshape(3, 2).astype(np.float64) + low))
        kept.append(number)
    region = np.array(kept, np.int32)
    return Triangles(np.array(corners).reshape(-1, 3, 2), regions.ink[region], region)


def _region_boxes(owner: NDArray[np.int32], count: int) -> RegionBoxes:
    """The boxes of all regions; an empty region has left > right."""
    y, x = np.nonzero(owner)
    number = owner[y, x] - 1
    low, high = np.full((2, count), 1 << 30, np.intp), np.full((2, count), -1, np.intp)
    for axis, pixel in enumerate((x, y)):
        np.minimum.at(low[axis], number, pixel)
        np.maximum.at(high[axis], number, pixel)
    return RegionBoxes(low[0], low[1], high[0], high[1])


def _largest_contour(mask: NDArray[np.uint8]) -> NDArray[np.int32]:
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(max(contours, key=len))


def _order_clockwise(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """The corners in clockwise order as seen in the image."""
    (ax, ay), (bx, by) = corner[1] - corner[0], corner[2] - corner[0]
    return corner if ax * by - ay * bx > 0 else corner[::-1]
