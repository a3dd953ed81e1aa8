"""Markers that are measured, but vaguely, as under dirt: what others say of them is weighed against it."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled

UNCERTAIN_DEVIATION = (
    0.02  # in edges, deviation of a marker about which others may know more: they know no less than 0.012
)


@compiled
def find_uncertain_markers(cov, edge):  # type: ignore[no-untyped-def]
    """(M,) bool, the markers that are measured vaguely, by their covariances (M, 2, 2) and edges (M,); and whether
    there are any."""
    out = np.zeros(edge.shape[0], np.bool_)
    for m in range(edge.shape[0]):
        out[m] = cov[m, 0, 0] + cov[m, 1, 1] > (UNCERTAIN_DEVIATION * edge[m]) ** 2
    return out, np.any(out)


@compiled
def update_by_fusion(xy, cov, place, variance):  # type: ignore[no-untyped-def]
    """Move a marker (2,) towards the ``place`` where others put it, each counting by how sure it is; in place, with its
    covariance (2, 2). ``variance``: of that place, along and across."""
    xx, cross, yy = cov[0, 0] + variance, cov[0, 1], cov[1, 1] + variance
    determinant = xx * yy - cross * cross
    dx, dy = place[0] - xy[0], place[1] - xy[1]
    a, b = (yy * dx - cross * dy) / determinant, (xx * dy - cross * dx) / determinant
    # of two independent measurements: P (P + V)^-1 of the way, and V (P + V)^-1 P is what is left unknown
    xy[0] += cov[0, 0] * a + cov[0, 1] * b
    xy[1] += cov[0, 1] * a + cov[1, 1] * b
    left = variance / determinant
    own = cov[0, 0] * cov[1, 1] - cross * cross
    cov[0, 0], cov[1, 1] = left * (own + variance * cov[0, 0]), left * (own + variance * cov[1, 1])
    cov[0, 1] = cov[1, 0] = left * variance * cross
