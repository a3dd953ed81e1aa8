"""The compiled depth buffer: a loop over triangles and pixels."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def fill_depth_buffer(corners, depth, number):  # type: ignore[no-untyped-def]
    """Draw triangles into a depth buffer.

    Args:
        corners: (T, 3, 3) float64, per corner x and y in px (y down) and z towards the viewer.
        depth: (H, W) float64, largest z per pixel; updated.
        number: (H, W) int64, number of the triangle with that z; updated.
    """
    height, width = depth.shape
    for t in range(corners.shape[0]):
        ax, ay, az = corners[t, 0]
        bx, by, bz = corners[t, 1]
        cx, cy, cz = corners[t, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        # With y down, the corners of a triangle that faces the viewer run clockwise: a negative area.
        if area >= 0.0:
            continue
        top = max(int(np.ceil(min(ay, by, cy))), 0)
        bottom = min(int(np.floor(max(ay, by, cy))), height - 1)
        left = max(int(np.ceil(min(ax, bx, cx))), 0)
        right = min(int(np.floor(max(ax, bx, cx))), width - 1)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                u = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area
                v = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area
                w = 1.0 - u - v
                if u >= 0.0 and v >= 0.0 and w >= 0.0:
                    z = u * az + v * bz + w * cz
                    if z > depth[y, x]:
                        depth[y, x] = z
                        number[y, x] = t
