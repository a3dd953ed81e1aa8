"""Homographies of points, their derivatives, and their fit by Gauss-Newton."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

PARAMETERS = 8  # of a homography with H[2, 2] = 1
FIT_STEPS = 20
CONVERGED = 1e-12  # change of a parameter, in units of the scaled points

Array = NDArray[np.float64]


def scaling(xy: Array) -> Array:
    """(3, 3) similarity that moves points (N, 2) to the mean 0 and the root mean square 1 per axis; NaN is left out."""
    known = xy[np.isfinite(xy).all(axis=1)]
    middle = known.mean(axis=0)
    scale = 1.0 / max(float(np.sqrt(((known - middle) ** 2).mean())), np.finfo(np.float64).tiny)
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])


def mapped(homography: Array, xy: Array) -> Array:
    """(..., N, 2) the points (..., N, 2) mapped by homographies (..., 3, 3); NaN stays NaN."""
    image = xy @ np.swapaxes(homography[..., :, :2], -1, -2) + homography[..., None, :, 2]
    return np.asarray(image[..., :2] / image[..., 2:])


def normalised(homography: Array) -> Array:
    """The homographies (..., 3, 3) with H[2, 2] = 1."""
    return np.asarray(homography / homography[..., 2:, 2:])


def derivatives(homography: Array, xy: Array) -> tuple[Array, Array]:
    """The derivatives of mapped points.

    Args:
        homography: (..., 3, 3) with H[2, 2] = 1.
        xy: (N, 2) points.

    Returns:
        (..., N, 2, 8) by the first eight entries of H, row by row, and (..., N, 2, 2) by the point.
    """
    image = mapped(homography, xy)
    weight = xy @ homography[..., 2, :2, None] + 1.0  # (..., N, 1)
    by_entries = np.zeros((*image.shape, PARAMETERS))
    scaled = np.concatenate([xy / weight, 1.0 / weight], axis=-1)
    by_entries[..., 0, 0:3] = scaled
    by_entries[..., 1, 3:6] = scaled
    by_entries[..., 6:8] = -image[..., :, None] * scaled[..., None, :2]
    by_point = homography[..., None, :2, :2] - image[..., :, None] * homography[..., None, None, 2, :2]
    return by_entries, np.asarray(by_point / weight[..., None])


def moved(homography: Array, step: Array) -> Array:
    """The homographies (..., 3, 3) with a step (..., 8) added to their first eight entries."""
    flat = homography.reshape(*homography.shape[:-2], 9).copy()
    flat[..., :PARAMETERS] += step
    return flat.reshape(homography.shape)


def fitted_homography(start: Array, end: Array) -> Array:
    """(3, 3) the homography, H[2, 2] = 1, that maps points (N, 2) best to others, by least squares of distances.

    Both lists of points are scaled (see ``scaling``), at least four, not all but one of them on a line.

    Raises:
        numpy.linalg.LinAlgError: the points determine no homography.
    """
    found, _ = cv2.findHomography(start, end)
    if found is None:
        raise np.linalg.LinAlgError("the points determine no homography")
    homography = normalised(np.asarray(found, dtype=np.float64))
    for _ in range(FIT_STEPS):
        by_entries, _ = derivatives(homography, start)
        rows = by_entries.reshape(-1, PARAMETERS)
        right = rows.T @ (end - mapped(homography, start)).ravel()
        step = np.asarray(np.linalg.solve(rows.T @ rows, right), np.float64)
        homography = moved(homography, step)
        if np.abs(step).max() < CONVERGED:
            break
    return homography
