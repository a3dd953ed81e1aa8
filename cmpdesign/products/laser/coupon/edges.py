"""The edges of a coupon's wide openings: pixel values over the distance from each edge, without interpolation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.files.images import Image
from cmpdesign.products.laser.coupon.design import Coupon
from cmpdesign.products.laser.coupon.fiducials import FiducialFit
from cmpdesign.products.laser.coupon.openings import LENGTH_SHARE, Across, measured_directions
from cmpdesign.products.laser.coupon.picture import Values, image_points

# Reach on both sides of an edge, and the width of the bins into which pixels are averaged.
REACH_MM, REACH_PX, BIN_PX = 0.9, 14.0, 0.25


@dataclass(frozen=True, eq=False)
class EdgeValues:
    """The pixels of all edges, averaged in bins of distance.

    Attributes:
        edge: (N,) int64, number of each bin's edge, from 0.
        distance_px: (N,) mean distance from the edge's expected place, positive inside the opening.
        value: (N,) mean value, 0 to 255, over the channels.
        pixels: (N,) number of pixels in each bin.
    """

    edge: NDArray[np.int64]
    distance_px: Values
    value: Values
    pixels: Values

    @property
    def count(self) -> int:
        """The number of edges."""
        return int(self.edge.max()) + 1


def read_edges(coupon: Coupon, image: Image, fit: FiducialFit, kerf_mm: float) -> EdgeValues:
    """Read both edges of every wide opening in both directions.

    Args:
        coupon: the coupon.
        image: (H, W, 3) uint8 or uint16.
        fit: the map of the coupon.
        kerf_mm: approximate kerf, for the expected places of the edges.
    """
    reach_mm = min(REACH_MM, REACH_PX / fit.scale)
    bins: list[Values] = []
    sides = [(one, side) for one in measured_directions(coupon) if one.wide for side in (-1, 1)]
    for number, (across, side) in enumerate(sides):
        binned = _binned_edge(image, fit, _EdgePlace(across, side, (across.width_mm + kerf_mm) / 2, reach_mm))
        bins.append(np.column_stack([np.full(len(binned), number), binned]))
    number, distance_px, value, pixels = np.concatenate(bins).T
    return EdgeValues(number.astype(np.int64), distance_px, value, pixels)


@dataclass(frozen=True)
class _EdgePlace:
    """One edge of an opening: the side (-1 or 1), its distance from the opening's centre, and the reach, mm."""

    across: Across
    side: int
    from_centre_mm: float
    reach_mm: float

    def corners_mm(self) -> Values:
        """(4, 2) the corners of the region that is read."""
        half = LENGTH_SHARE / 2 * self.across.length_mm
        u = self.side * (self.from_centre_mm + np.array([-1, 1, 1, -1]) * self.reach_mm)
        v = np.array([-half, -half, half, half])
        centre = (self.across.opening.x_mm, self.across.opening.y_mm)
        return np.asarray(np.stack([u, v] if self.across.along_x else [v, u], axis=1) + centre)

    def contains(self, points_mm: Values) -> NDArray[np.bool_]:
        """(N,) True for the points of (N, 2) within the region."""
        offset = points_mm - (self.across.opening.x_mm, self.across.opening.y_mm)
        u, v = offset.T if self.across.along_x else offset.T[::-1]
        near = np.abs(self.from_centre_mm - self.side * u) < self.reach_mm
        return np.asarray(near & (np.abs(v) < LENGTH_SHARE / 2 * self.across.length_mm))


def _binned_edge(image: Image, fit: FiducialFit, place: _EdgePlace) -> Values:
    """(B, 3) distance in px, value and number of pixels of each bin."""
    box = image_points(fit.to_image, place.corners_mm(), image.shape)
    left, top = np.floor(box.min(axis=0)).astype(int)
    right, bottom = np.ceil(box.max(axis=0)).astype(int) + 1
    cut = image[top:bottom, left:right].mean(axis=2) / (257.0 if image.dtype == np.uint16 else 1.0)
    rows, columns = np.mgrid[top : top + cut.shape[0], left : left + cut.shape[1]]
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
    near = place.contains(fit.to_coupon(pixels))
    # The edge lies midway between both ends of the region, and the first corner lies inside the opening.
    start, end = (
        fit.to_image(ends.mean(axis=0)[None])[0] for ends in np.split(place.corners_mm()[[0, 1, 2, 3]], 2)
    )
    along = (end - start) / np.linalg.norm(end - start)
    inward = fit.to_image(place.corners_mm()[[0]])[0] - start
    normal = np.array([-along[1], along[0]])
    normal *= np.sign(normal @ inward)
    distance_px, values = (pixels[near] - start) @ normal, cut.ravel()[near]
    number = np.floor(distance_px / BIN_PX).astype(np.int64)
    number -= number.min()
    counts = np.bincount(number)
    used = counts > 0
    means = [np.bincount(number, weights=each)[used] / counts[used] for each in (distance_px, values)]
    return np.column_stack([*means, counts[used]])
