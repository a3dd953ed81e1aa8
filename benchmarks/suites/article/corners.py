"""The article's corners: triangles fitted to the contours of the regions that its AGA has grown, nothing finer."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.cells.region_growing import Regions
from extractor.cells.triangle_fit import Triangles

MIN_AREA_PX = 4.0
MIN_FILL = 0.6  # of the triangle by its contour: what fills less is no triangle ("area, perimeter")


def fit_plain_triangles(regions: Regions) -> Triangles:
    """The smallest triangle around every region, where the region fills it."""
    corners, kept = [], []
    left, top, right, bottom = _region_boxes(regions.owner, len(regions.ink))
    for number in range(len(regions.ink)):
        if right[number] < left[number]:
            continue
        low = np.array([left[number], top[number]])
        part = regions.owner[top[number] : bottom[number] + 1, left[number] : right[number] + 1]
        contour = _largest_contour((part == number + 1).astype(np.uint8))
        area, corner = cv2.minEnclosingTriangle(contour)
        if corner is None or area < MIN_AREA_PX or cv2.contourArea(contour) < MIN_FILL * area:
            continue
        corners.append(_order_clockwise(corner.reshape(3, 2).astype(np.float64) + low))
        kept.append(number)
    region = np.array(kept, np.int32)
    return Triangles(np.array(corners).reshape(-1, 3, 2), regions.ink[region], region)


def _region_boxes(owner: NDArray[np.int32], count: int) -> tuple[NDArray[np.intp], ...]:
    """Left, top, right and bottom of every region, each (count,) px."""
    y, x = np.nonzero(owner)
    number = owner[y, x] - 1
    found = []
    for at, join, start in ((x, np.minimum, 1 << 30), (y, np.minimum, 1 << 30)):
        found.append(np.full(count, start, np.intp))
        join.at(found[-1], number, at)
    for at in (x, y):
        found.append(np.full(count, -1, np.intp))
        np.maximum.at(found[-1], number, at)
    return tuple(found)


def _largest_contour(mask: NDArray[np.uint8]) -> NDArray[np.int32]:
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(max(contours, key=len))


def _order_clockwise(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """The corners in clockwise order as seen in the image."""
    (ax, ay), (bx, by) = corner[1] - corner[0], corner[2] - corner[0]
    return corner if ax * by - ay * bx > 0 else corner[::-1]
