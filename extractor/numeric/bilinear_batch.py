"""Bilinear samples of an image at many sub-pixel points together, in branch-free loops that the compiler vectorises.

The samples equal those of ``bilinear`` to the last bit. Places are fixed-point numbers, 2^-32 px.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.bilinear import BORDER_PX, HEXAGON_POINTS, SUBPIXEL_STEPS
from extractor.numeric.compilation import compiled

FIXED_POINT_ONE = float(1 << 32)  # one pixel
HALF_STEP = 1 << 23  # 0.5 / SUBPIXEL_STEPS px
BATCH_POINTS = 192  # points sampled together at most
# Begins of columns: of ``fixed_points``, of ``channel_sums``, and with X and Y of ``patches``.
X, Y, PIXEL_INDEX = (k * BATCH_POINTS for k in range(3))
BLUE, GREEN, RED, FRACTION_X, FRACTION_Y = (k * BATCH_POINTS for k in range(5))
RADIUS, COLOR, INSIDE = 2 * BATCH_POINTS, 3 * BATCH_POINTS, 6 * BATCH_POINTS


class SampleBuffers(NamedTuple):
    """Memory for P = ``BATCH_POINTS`` samples; every array consists of columns of P.

    Attributes:
        fixed_points: (3 P,) int64, the columns ``X`` and ``Y``, by ``fixed_point_coordinate``, and ``PIXEL_INDEX``, the
            flat index of the first of the four pixels.
        pixel_words: (4 P,) uint32, bytes of the four pixels.
        channel_sums: (5 P,) float32, the columns ``BLUE``, ``GREEN`` and ``RED``, each channel times the square of
            ``SUBPIXEL_STEPS``, and ``FRACTION_X`` and ``FRACTION_Y``, the sub-pixel parts in steps.
        patches: (7 P,) float64, the columns ``X``, ``Y`` and ``RADIUS``, px, three of ``COLOR``, and ``INSIDE``, 1 in
            the image, else 0.
    """

    fixed_points: NDArray[np.int64]
    pixel_words: NDArray[np.uint32]
    channel_sums: NDArray[np.float32]
    patches: NDArray[np.float64]


@compiled
def fixed_point_coordinate(place_px):  # type: ignore[no-untyped-def]
    """A coordinate as an integer multiple of 2^-32 px, plus half a sub-pixel step, so that truncation rounds it."""
    return np.int64(place_px * FIXED_POINT_ONE) + HALF_STEP


@compiled
def fixed_point_length(length_px):  # type: ignore[no-untyped-def]
    """A length as an integer multiple of 2^-32 px."""
    return np.int64(length_px * FIXED_POINT_ONE)


@compiled
def allocate_sample_buffers():  # type: ignore[no-untyped-def]
    """``SampleBuffers`` of zeros."""
    return SampleBuffers(
        np.zeros(3 * BATCH_POINTS, np.int64),
        np.zeros(4 * BATCH_POINTS, np.uint32),
        np.zeros(5 * BATCH_POINTS, np.float32),
        np.zeros(7 * BATCH_POINTS),
    )


@compiled
def _fill_pixel_indices(height, width, points, fractions, count):  # type: ignore[no-untyped-def]
    """Write the flat index of the four pixels around each of the first points, and its sub-pixel parts."""
    for i in range(count):
        x, y = points[X + i], points[Y + i]
        ix, iy = min(x >> 32, width - 2), min(y >> 32, height - 2)
        points[PIXEL_INDEX + i] = 3 * (iy * width + ix)
        fractions[FRACTION_X + i], fractions[FRACTION_Y + i] = (
            (x >> 24) - SUBPIXEL_STEPS * ix,
            (y >> 24) - SUBPIXEL_STEPS * iy,
        )


@compiled
def _read_word(flat, at):  # type: ignore[no-untyped-def]
    """Four bytes as one number, which compiles to one load."""
    a, b, c, d = flat[at], flat[at + np.uint64(1)], flat[at + np.uint64(2)], flat[at + np.uint64(3)]
    low = np.uint32(a) | np.uint32(b) << np.uint32(8)
    return low | np.uint32(c) << np.uint32(16) | np.uint32(d) << np.uint32(24)


@compiled
def _fill_pixel_words(flat, width, points, words, count):  # type: ignore[no-untyped-def]
    """Read the first and the last four of the six bytes of two adjacent pixels, and of the two below."""
    two, below = np.uint64(2), np.uint64(3 * width)
    for i in range(count):
        k = np.uint64(points[PIXEL_INDEX + i])
        words[i], words[BATCH_POINTS + i] = _read_word(flat, k), _read_word(flat, k + two)
        words[2 * BATCH_POINTS + i], words[3 * BATCH_POINTS + i] = (
            _read_word(flat, k + below),
            _read_word(flat, k + below + two),
        )


@compiled
def _byte(word, number):  # type: ignore[no-untyped-def]
    """Byte ``number`` of a word, 0 the lowest."""
    return np.float32(np.int32(word >> np.uint32(8 * number)) & np.int32(255))


@compiled
def _fill_channel_sums(words, parts, count):  # type: ignore[no-untyped-def]
    """Write the channels' weighted sums: integers below 2^24, which float32 represents exactly."""
    steps = np.float32(SUBPIXEL_STEPS)
    for i in range(count):
        a, b, c, d = (
            words[i],
            words[BATCH_POINTS + i],
            words[2 * BATCH_POINTS + i],
            words[3 * BATCH_POINTS + i],
        )
        across, down = parts[FRACTION_X + i], parts[FRACTION_Y + i]
        both = across * down
        right, under = steps * across - both, steps * down - both
        rest = steps * (steps - across - down) + both
        above, below = rest * _byte(a, 0) + right * _byte(b, 1), under * _byte(c, 0) + both * _byte(d, 1)
        parts[BLUE + i] = above + below
        above, below = rest * _byte(a, 1) + right * _byte(b, 2), under * _byte(c, 1) + both * _byte(d, 2)
        parts[GREEN + i] = above + below
        above, below = rest * _byte(b, 0) + right * _byte(b, 3), under * _byte(d, 0) + both * _byte(d, 3)
        parts[RED + i] = above + below


@compiled
def fill_point_samples(flat, height, width, count, buffers):  # type: ignore[no-untyped-def]
    """Sample the image at the first ``count`` fixed points of ``SampleBuffers``, which must lie in the image."""
    _fill_pixel_indices(height, width, buffers.fixed_points, buffers.channel_sums, count)
    _fill_pixel_words(flat, width, buffers.fixed_points, buffers.pixel_words, count)
    _fill_channel_sums(buffers.pixel_words, buffers.channel_sums, count)


@compiled
def fill_patch_means(flat, height, width, count, buffers):  # type: ignore[no-untyped-def]
    """``fill_patch_mean`` for the first ``count`` patches of ``SampleBuffers``."""
    patches, parts = buffers.patches, buffers.channel_sums
    for i in range(count):
        x, y, r = patches[X + i], patches[Y + i], patches[RADIUS + i]
        inside = (r >= 0.0) & (x >= r) & (y >= r) & (x <= width - 1.0 - r) & (y <= height - 1.0 - r)
        patches[INSIDE + i] = inside
        for channel in range(3):
            patches[COLOR + channel * BATCH_POINTS + i] = 0.0
    for k in range(HEXAGON_POINTS.shape[0]):
        _fill_hexagon_points(height, width, k, patches, buffers.fixed_points, count)
        fill_point_samples(flat, height, width, count, buffers)
        for channel in range(3):
            for i in range(count):
                patches[COLOR + channel * BATCH_POINTS + i] += parts[channel * BATCH_POINTS + i]
    for channel in range(3):
        for i in range(count):
            patches[COLOR + channel * BATCH_POINTS + i] *= 1.0 / (7 * SUBPIXEL_STEPS * SUBPIXEL_STEPS)


@compiled
def _fill_hexagon_points(height, width, k, patches, points, count):  # type: ignore[no-untyped-def]
    """Write point k of the hexagon of every patch; (0, 0) for patches outside the image."""
    u, v = HEXAGON_POINTS[k]
    for i in range(count):
        x, y = patches[X + i] + patches[RADIUS + i] * u, patches[Y + i] + patches[RADIUS + i] * v
        inside = patches[INSIDE + i] > 0.0
        points[X + i] = fixed_point_coordinate(min(x, width - BORDER_PX) if inside else 0.0)
        points[Y + i] = fixed_point_coordinate(min(y, height - BORDER_PX) if inside else 0.0)
