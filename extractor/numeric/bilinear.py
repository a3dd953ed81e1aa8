"""Bilinear samples of an image at sub-pixel points, for use inside compiled loops.

The image (H, W, 3) uint8 is passed as ``flat`` (3 H W,) with its height and width: numba needs no wrap-around for
unsigned flat indices. Sub-pixel parts are rounded to 1 / ``SUBPIXEL_STEPS`` px.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import compiled

SUBPIXEL_STEPS = 256  # per pixel
BORDER_PX = 1.0 + 1e-6  # distance of the last sample from the image's width or height
# The center and the corners of a hexagon of radius 1.
HEXAGON_POINTS = np.array(
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
def weighted_sample(flat, height, width, x, y, red, green, blue):  # type: ignore[no-untyped-def]
    """The sample at (x, y), the channels multiplied by the weights red, green and blue; NaN outside the image.

    The weights apply to channels 0, 1 and 2, in this order.
    """
    if not (x >= 0.0 and y >= 0.0 and x <= width - 1.0 and y <= height - 1.0):
        return np.nan
    x, y = min(x, width - BORDER_PX), min(y, height - BORDER_PX)
    ix, iy = int(x), int(y)
    fx, fy = np.int64((x - ix) * SUBPIXEL_STEPS + 0.5), np.int64((y - iy) * SUBPIXEL_STEPS + 0.5)
    a = np.uint64((iy * width + ix) * 3)
    b = np.uint64(a + np.uint64(width * 3))
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    four, five = np.uint64(4), np.uint64(5)
    both = fx * fy  # integers are faster
    right, down, rest = (
        SUBPIXEL_STEPS * fx - both,
        SUBPIXEL_STEPS * fy - both,
        SUBPIXEL_STEPS * (SUBPIXEL_STEPS - fx - fy) + both,
    )
    s0 = rest * flat[a] + right * flat[a + three] + down * flat[b] + both * flat[b + three]
    s1 = rest * flat[a + one] + right * flat[a + four] + down * flat[b + one] + both * flat[b + four]
    s2 = rest * flat[a + two] + right * flat[a + five] + down * flat[b + two] + both * flat[b + five]
    return (red * s0 + green * s1 + blue * s2) * (1.0 / (SUBPIXEL_STEPS * SUBPIXEL_STEPS))


@compiled
def fill_patch_mean(flat, height, width, x, y, radius, out):  # type: ignore[no-untyped-def]
    """Write the mean (3,) of seven samples, at (x, y) and on a hexagon of ``radius`` px; False outside the image."""
    if not (x >= radius and y >= radius and x <= width - 1.0 - radius and y <= height - 1.0 - radius):
        return False
    s0, s1, s2 = np.int64(0), np.int64(0), np.int64(0)
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    four, five = np.uint64(4), np.uint64(5)
    for k in range(7):
        px, py = (
            min(x + radius * HEXAGON_POINTS[k, 0], width - BORDER_PX),
            min(y + radius * HEXAGON_POINTS[k, 1], height - BORDER_PX),
        )
        ix, iy = int(px), int(py)
        fx, fy = np.int64((px - ix) * SUBPIXEL_STEPS + 0.5), np.int64((py - iy) * SUBPIXEL_STEPS + 0.5)
        a = np.uint64((iy * width + ix) * 3)
        b = np.uint64(a + np.uint64(width * 3))
        both = fx * fy
        right, down, rest = (
            SUBPIXEL_STEPS * fx - both,
            SUBPIXEL_STEPS * fy - both,
            SUBPIXEL_STEPS * (SUBPIXEL_STEPS - fx - fy) + both,
        )
        s0 += rest * flat[a] + right * flat[a + three] + down * flat[b] + both * flat[b + three]
        s1 += rest * flat[a + one] + right * flat[a + four] + down * flat[b + one] + both * flat[b + four]
        s2 += rest * flat[a + two] + right * flat[a + five] + down * flat[b + two] + both * flat[b + five]
    share = 1.0 / (7 * SUBPIXEL_STEPS * SUBPIXEL_STEPS)
    out[0], out[1], out[2] = s0 * share, s1 * share, s2 * share
    return True
