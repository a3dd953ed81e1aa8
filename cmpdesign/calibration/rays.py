"""The error of a camera's rays that follows from the covariance of its parameters, pixel by pixel.

A turn of the camera turns all rays together and is part of the pose, not of the calibration: errors are stated after
the turn that makes them least over the image (as the projection uncertainty of mrcal, whose reference is the cloud of
points). With the derivatives J of the places of fixed directions by the parameters and T by a turn, the covariance is
P J C J' P', for P = 1 - T (T'T)^-1 T'.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor import View

Array = NDArray[np.float64]

COLUMNS, ROWS = 24, 18


def pixel_grid(size_px: tuple[int, int], columns: int = COLUMNS, rows: int = ROWS) -> Array:
    """(rows * columns, 2) px, evenly over the image to its outermost pixels."""
    x, y = np.linspace(0, size_px[0] - 1, columns), np.linspace(0, size_px[1] - 1, rows)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def turn_columns(view: View, directions: Array) -> Array:
    """(N, 2, 3) derivatives of the places of directions (N, 2) by a turn of the camera."""
    x, y = directions.T
    one = np.ones_like(x)
    by_turn = np.stack(
        [np.column_stack([-x * y, 1 + x * x, -y]), np.column_stack([-(one + y * y), x * y, x])], axis=1
    )
    step = 1e-6
    columns = []
    for k in range(3):
        ends = [places(view, directions + sign * step * by_turn[:, :, k]) for sign in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=2)


def places(view: View, directions: Array) -> Array:
    """(N, 2) px of directions (N, 2), without a pose."""
    posed = view.at(np.eye(3), np.zeros(3))
    return posed.project(np.column_stack([directions, np.ones(len(directions))]))


def without_turn(view: View, directions: Array, moved_px: Array) -> Array:
    """(N, 2, ...) px, moves of the places of directions less the turn of the camera that explains most of them."""
    turn = turn_columns(view, directions).reshape(-1, 3)
    flat = moved_px.reshape(len(turn), -1)
    return np.asarray((flat - turn @ np.linalg.lstsq(turn, flat, rcond=None)[0]).reshape(moved_px.shape))


def ray_covariances(view: View, cov: Array, xy_px: Array) -> Array:
    """(N, 2, 2) px^2 of the rays of pixels (N, 2), for the parameters' covariance; NaN outside the lens."""
    directions = view.normalised(xy_px)
    known = np.isfinite(directions).all(axis=1)
    out = np.full((len(xy_px), 2, 2), np.nan)
    moved = without_turn(view, directions[known], view.by_lens(directions[known]))
    out[known] = moved @ cov @ np.swapaxes(moved, 1, 2)
    return out


def ray_differences(view: View, other: View, xy_px: Array) -> Array:
    """(N, 2) px by which another camera shows the rays of this camera's pixels, less a common turn."""
    directions = view.normalised(xy_px)
    out = np.full((len(xy_px), 2), np.nan)
    shown = np.full((len(xy_px), 2), np.nan)
    known = np.isfinite(directions).all(axis=1)
    shown[known] = places(other, directions[known])
    known &= np.isfinite(shown).all(axis=1)
    moved = shown[known] - places(view, directions[known])
    out[known] = without_turn(view, directions[known], moved)
    return out
