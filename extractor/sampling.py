"""Bilinear samples of an image at sub-pixel points, for use inside compiled loops.

The image is passed flat, with its height and width: unsigned flat indices spare numba the wrap-around of negative ones.
"""

from __future__ import annotations

import numpy as np

from .engine import compiled

HEXAGON = np.array(
    [
        [0.0, 0.0],
        [1.0, 0.0],
        [0.5, 0.75**0.5],
        [-0.5, 0.75**0.5],
        [-1.0, 0.0],
        [-0.5, -(0.75**0.5)],
        [0.5, -(0.75**0.5)],
    ]
)


@compiled
def sample_dot(flat, height, width, x, y, red, green, blue):  # type: ignore[no-untyped-def]
    """The sample at (x, y) of the image's channels (in their order) weighted and summed; NaN outside the image."""
    if not (x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0):
        return np.nan
    ix, iy = min(int(x), width - 2), min(int(y), height - 2)
    fx, fy = x - ix, y - iy
    a = np.uint64((iy * width + ix) * 3)
    b = np.uint64(a + np.uint64(width * 3))
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    four, five = np.uint64(4), np.uint64(5)
    left = red * flat[a] + green * flat[a + one] + blue * flat[a + two]
    right = red * flat[a + three] + green * flat[a + four] + blue * flat[a + five]
    below_left = red * flat[b] + green * flat[b + one] + blue * flat[b + two]
    below_right = red * flat[b + three] + green * flat[b + four] + blue * flat[b + five]
    top = left + fx * (right - left)
    return top + fy * (below_left + fx * (below_right - below_left) - top)


@compiled
def sample_patch(flat, height, width, x, y, radius, out):  # type: ignore[no-untyped-def]
    """Write the mean of seven samples, the center and a hexagon of ``radius`` around it; False outside the image."""
    if not (x >= radius and y >= radius and x <= width - 1.0 - radius and y <= height - 1.0 - radius):
        return False
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    for k in range(7):
        px, py = x + radius * HEXAGON[k, 0], y + radius * HEXAGON[k, 1]
        ix, iy = min(int(px), width - 2), min(int(py), height - 2)
        fx, fy = px - ix, py - iy
        a = np.uint64((iy * width + ix) * 3)
        b = np.uint64(a + np.uint64(width * 3))
        for c in range(3):
            at, below, right = np.uint64(a + np.uint64(c)), np.uint64(b + np.uint64(c)), np.uint64(3)
            top = flat[at] * (1.0 - fx) + flat[at + right] * fx
            bottom = flat[below] * (1.0 - fx) + flat[below + right] * fx
            out[c] += (top + fy * (bottom - top)) / 7.0
    return True


@compiled
def clamp(value, low, high):  # type: ignore[no-untyped-def]
    """The value held between low and high; NaN stays NaN."""
    if value < low:
        return low
    if value > high:
        return high
    return value
