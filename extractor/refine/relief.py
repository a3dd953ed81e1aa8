"""Markers of pads whose cells stand above or below the black: from where they appear to the plane of the black.

A camera that does not look along the normal sees the walls of such cells on one side; on the other side the cells hide
what lies behind. Sides whose normal points along the parallax of the cells' height and sides that face the other way
are displaced by different shares of that parallax. Half of the sum displaces all markers alike, which a picture alone
does not show. Half of the difference makes cells seem smaller (recessed) or larger (raised) along the parallax. That is
seen, and shows the foot, where the camera looks along the normal. The shift of the markers grows from there, towards
the foot for recessed cells. How fast depends on field of view, walls and shadows, which a picture does not tell: the
rate has a prior with a wide deviation, which the covariances contain. Where the height is not known, neither is the
sign of the rate; its deviation then follows from the half of the difference.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.layout.topology import Topology

Points = NDArray[np.float64]


class ReliefLimits(NamedTuple):
    """Limits and priors of the parallax of cells.

    Attributes:
        rate, rate_deviation: the shift of a marker, in units of the cells' height times the distance from the foot
            over the image's width. Derived: the parallax is 2 tan(half of the field of view) / index, 0.7 to 2 for 50
            to 90 degrees through air or gel; walls alone shift by half of it, with shadows on the same side by all
            of it. The middle of 0.4 to 1.6, and the deviation of a uniform distribution there.
        rounds, grid, grid_reach: rounds of places that are tried for the foot, places along each axis, and their reach
            in deviations of the prior, or of the foot after the round before. Chosen.
        correlated: gridlines whose errors are alike; the evidence counts by one of so many. Chosen.
        min_gridlines: with fewer, the foot has its prior. Chosen.
    """

    rate: float = 1.0
    rate_deviation: float = 0.35
    rounds: int = 2
    grid: int = 15
    grid_reach: float = 3.0
    correlated: float = 8.0
    min_gridlines: int = 30


LIMITS = ReliefLimits()


class Parallax(NamedTuple):
    """The shift of points of the cells against the black, a linear field, and its covariance.

    Attributes:
        foot_px: (2,) where the shift is zero. foot_cov_px2: (2, 2).
        rate, rate_deviation: px of shift for each px from the foot.
    """

    foot_px: Points
    foot_cov_px2: Points
    rate: float
    rate_deviation: float

    def shift_px(self, xy_px: Points) -> Points:
        """(N, 2) of points (N, 2)."""
        return self.rate * (xy_px - self.foot_px)

    def cov_px2(self, xy_px: Points) -> Points:
        """(N, 2, 2) of the shift at points (N, 2)."""
        away = self.rate_deviation * (xy_px - self.foot_px)
        of_foot = (self.rate_deviation**2 + self.rate**2) * self.foot_cov_px2
        return away[:, :, None] * away[:, None, :] + of_foot


def find_parallax(topology: Topology, xy_px: Points, points_px: Points, size_px: Points) -> Parallax:
    """The parallax of the cells of a picture.

    Args:
        topology: with the height of its cells.
        xy_px: (M, 2) markers as they appear, NaN where lost.
        points_px: (E, m, 2) points on the gridlines as they appear, NaN where not measured.
        size_px: (2,) width and height of the image.
    """
    width_px, middle_px = float(size_px[0]), 0.5 * (size_px - 1.0)
    ends = xy_px[topology.edges]
    length_px = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    length_px = length_px[np.isfinite(length_px)]
    edge_px = float(np.median(length_px)) if len(length_px) else 0.0
    height = topology.cell_height * edge_px / width_px
    normal, outward = _outward_offsets(topology, xy_px, points_px)
    known = np.isfinite(outward)
    if known.sum() < LIMITS.min_gridlines:
        known[:] = False
    place, sign = ends.mean(axis=1)[known] - middle_px, float(np.sign(topology.cell_height))
    foot, deviations_px = np.zeros(2), np.full(2, native.FOOT_DEVIATION * width_px)
    for _ in range(LIMITS.rounds):
        steps = np.linspace(-LIMITS.grid_reach, LIMITS.grid_reach, LIMITS.grid)
        feet = foot + np.stack(np.meshgrid(*steps * deviations_px[:, None]), axis=-1).reshape(-1, 2)
        log_share = -0.5 * (feet**2).sum(axis=1) / (native.FOOT_DEVIATION * width_px) ** 2
        log_share += _log_likelihood(feet, place, normal[known], outward[known], sign)
        share = np.exp(log_share - log_share.max())
        share /= share.sum()
        foot = share @ feet
        cov = (share * (feet - foot).T) @ (feet - foot)
        cov += np.diag((steps[1] - steps[0]) * deviations_px) ** 2 / 12
        deviations_px = np.sqrt(np.diag(cov))
    return Parallax(foot + middle_px, cov, LIMITS.rate * height, LIMITS.rate_deviation * abs(height))


def points_without_parallax(
    parallax: Parallax, edges: NDArray[np.int32], xy_px: Points, points_px: Points
) -> Points:
    """Points (E, m, 3) of gridlines (E, 2) in the plane of the black; xy (M, 2) are the markers there.

    The variance of a point is across its gridline.
    """
    chord = xy_px[edges[:, 1]] - xy_px[edges[:, 0]]
    normal = np.stack([-chord[:, 1], chord[:, 0]], axis=1) / np.linalg.norm(chord, axis=1, keepdims=True)
    flat = points_px[..., :2].reshape(-1, 2)
    moved = points_px.copy()
    moved[..., :2] -= parallax.shift_px(flat).reshape(moved[..., :2].shape)
    of_shift = parallax.cov_px2(flat).reshape(*moved.shape[:2], 2, 2)
    moved[..., 2] += np.einsum("ei,ejik,ek->ej", normal, of_shift, normal)
    return moved


def _outward_offsets(topology: Topology, xy_px: Points, points_px: Points) -> tuple[Points, Points]:
    """(E, 2) unit normals out of the only drawn cell beside each gridline, and (E,) px, the offset of its points there.

    NaN where a gridline has no or two drawn cells, or an unknown end.
    """
    ends = xy_px[topology.edges]
    chord = ends[:, 1] - ends[:, 0]
    count = points_px.shape[1]
    share = ((np.arange(count) + 1.0) / (count + 1.0))[:, None]
    off = points_px - (ends[:, :1] + share * chord[:, None])
    beside = topology.edge_cells.max(axis=1)
    middle = xy_px[topology.cells[beside]].mean(axis=1) - ends[:, 0]
    normal = np.stack([chord[:, 1], -chord[:, 0]], axis=1) / np.linalg.norm(chord, axis=1, keepdims=True)
    normal *= -np.sign((normal * middle).sum(axis=1, keepdims=True))
    offset = (off * normal[:, None]).sum(axis=2).mean(axis=1)
    offset[(topology.edge_cells >= 0).sum(axis=1) != 1] = np.nan
    return normal, offset


def _log_likelihood(feet: Points, place: Points, normal: Points, outward: Points, sign: float) -> Points:
    """(N,) of feet (N, 2): offsets are a constant and, along the parallax, proportional to it; of the height's sign."""
    if not len(outward):
        return np.zeros(len(feet))
    away = np.abs((normal * place).sum(axis=1)[:, None] - normal @ feet.T)
    away -= away.mean(axis=0)
    offset = outward - np.median(outward)
    reach = 3.0 * np.median(np.abs(offset)) + 1e-9
    offset = np.clip(offset, -reach, reach)
    offset -= offset.mean()
    slope = (offset @ away) / (away**2).sum(axis=0)
    slope = np.where(sign * slope > 0, slope, 0.0)
    squares = (offset**2).sum() - slope**2 * (away**2).sum(axis=0)
    variance = squares.min() / len(offset)
    return np.asarray(-0.5 * squares / (variance * LIMITS.correlated))
