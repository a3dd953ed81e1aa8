"""Uncertain markers, as under dirt: the measurement is fused with the prediction by other markers."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled

UNCERTAIN_DEVIATION = 0.02  # in edges, of a marker that others may predict better: at best to 0.012


@compiled
def find_uncertain_markers(cov, edge_px):  # type: ignore[no-untyped-def]
    """(M,) bool, the uncertain markers by their covariances (M, 2, 2) and edges (M,); and whether there are any."""
    uncertain = np.zeros(edge_px.shape[0], np.bool_)
    for m in range(edge_px.shape[0]):
        uncertain[m] = cov[m, 0, 0] + cov[m, 1, 1] > (UNCERTAIN_DEVIATION * edge_px[m]) ** 2
    return uncertain, np.any(uncertain)


@compiled
def update_by_fusion(xy, cov, predicted, variance):  # type: ignore[no-untyped-def]
    """Fuse a marker with an independent prediction of its place, in place.

    With the marker's covariance P and the prediction's V = variance * I, the marker moves by P (P + V)^-1 of the
    difference, and its covariance becomes V (P + V)^-1 P.

    Args:
        xy, cov: (2,) and (2, 2), the marker.
        predicted: (2,) the prediction, px.
        variance: of the prediction per axis, px^2.
    """
    xx, cross, yy = cov[0, 0] + variance, cov[0, 1], cov[1, 1] + variance
    determinant = xx * yy - cross * cross
    dx, dy = predicted[0] - xy[0], predicted[1] - xy[1]
    a, b = (yy * dx - cross * dy) / determinant, (xx * dy - cross * dx) / determinant
    xy[0] += cov[0, 0] * a + cov[0, 1] * b
    xy[1] += cov[0, 1] * a + cov[1, 1] * b
    factor = variance / determinant
    own = cov[0, 0] * cov[1, 1] - cross * cross
    cov[0, 0], cov[1, 1] = factor * (own + variance * cov[0, 0]), factor * (own + variance * cov[1, 1])
    cov[0, 1] = cov[1, 0] = factor * variance * cross
