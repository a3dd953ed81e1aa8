"""The residual, image minus drawn pattern (``pattern_drawing``), summed along the gridlines.

The weight of a pixel is the derivative of the drawing by the gridline's offset. That derivative falls towards the
gridline's two ends as 1 - t and t. The sums are the gradient of the log-likelihood and its curvature.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined_no_refcount, vectorized_no_refcount
from extractor.refine.synthesis.gridlines import KNOWN
from extractor.refine.synthesis.pixel_rows import (
    CHUNK,
    Residuals,
    RowBlock,
    allocate_residuals,
    fill_bleed,
    fill_residuals,
    fill_rows,
    padded_count,
    pixel_geometry,
    row_frame,
    row_sizes,
    side_light,
)
from extractor.refine.synthesis.pixel_weights import (
    BAND,
    BEFORE_SHARE,
    END_BELL,
    IN_BAND,
    TO_A,
    TO_B,
    TO_BLUR,
    TO_C,
    TO_D,
    fill_weights,
)

# columns of the sums over a gridline's pixels
AA, AB, BB, A, B, MISFIT, PIXELS, BLUR, BLUR_CURVATURE, A_BLUR, B_BLUR = range(11)
AC, AD, BC, BD, CC, CD, DD, C, D, C_BLUR, D_BLUR = range(11, 22)
READ_AA, READ_BB = 22, 23  # AA and BB as read, where bending is eliminated from them
SUMS = 24
FULL_DENSITY = np.float32(np.sqrt(2.0 * np.pi))  # by which the normal density is 1 on the gridline


class DrawnGridlines(NamedTuple):
    """Gridlines as they are drawn.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        sides: (E, 6), the light on both sides, as ``gridline_sides`` gives it.
        added: (E, 6), the light to add to the drawing on both sides: the black, and the change of the levels since.
        bleed: (E, 6) light, the change of the levels on both sides where the blur grows by its own width.
        is_bending: (E,) bool, gridlines with two more unknowns for their bending.
    """

    lines: NDArray[np.float64]
    sides: NDArray[np.float64]
    added: NDArray[np.float64]
    bleed: NDArray[np.float64]
    is_bending: NDArray[np.bool_]


class RowBuffers(NamedTuple):
    """Memory for the pixels of one gridline.

    Attributes:
        first: (n,) int64, the first pixels of the rows. rows: their columns. weights: seven columns of the pixels.
        residuals: of the pixels.
    """

    first: NDArray[np.int64]
    rows: NDArray[np.float32]
    weights: NDArray[np.float32]
    residuals: Residuals


@vectorized_no_refcount
def _accumulate_sums(residuals, weights, count, sums):  # type: ignore[no-untyped-def]
    """Add ``count`` pixels to a gridline's sums (24,)."""
    projection, information, square = residuals.projection, residuals.information, residuals.square
    bleed_projection, bleed_cross = residuals.bleed_projection, residuals.bleed_cross
    bleed_square, zero = residuals.bleed_square, np.float32(0.0)
    blur, curvature, misfit, pixels = zero, zero, zero, zero
    # in float64 the order of summing hardly changes the sums that move the markers
    double = np.float64(0.0)
    aa, ab, bb, sa, sb = double, double, double, double, double
    az, bz = zero, zero
    for k in range(count):
        ga, gb, gz = weights[TO_A + k], weights[TO_B + k], weights[TO_BLUR + k]
        own, pull = information[k], projection[k]
        by_a, by_b = own * ga, own * gb
        aa += by_a * ga
        ab += by_a * gb
        bb += by_b * gb
        # in the middles of cells the levels follow the image: bleed counts beside the gridline
        beside = FULL_DENSITY * (ga + gb)
        cross = beside * bleed_cross[k]
        blur_cross = own * gz + cross
        az += ga * blur_cross
        bz += gb * blur_cross
        sa += ga * pull
        sb += gb * pull
        in_band = weights[IN_BAND + k]
        blur += gz * pull + beside * bleed_projection[k]
        curvature += gz * (blur_cross + cross) + beside * beside * bleed_square[k]
        misfit += in_band * square[k]
        pixels += in_band
    sums[AA] += aa
    sums[AB] += ab
    sums[BB] += bb
    sums[A] += sa
    sums[B] += sb
    sums[BLUR] += blur
    sums[BLUR_CURVATURE] += curvature
    sums[A_BLUR] += az
    sums[B_BLUR] += bz
    sums[MISFIT] += misfit
    sums[PIXELS] += pixels


@vectorized_no_refcount
def _accumulate_bending_sums(residuals, weights, count, sums):  # type: ignore[no-untyped-def]
    """The same for the gridline's bending, with the weights t (1 - t) and t (1 - t) (1 - 2 t)."""
    projection, information, zero = residuals.projection, residuals.information, np.float32(0.0)
    bleed_cross = residuals.bleed_cross
    ac, ad, bc, bd, cc, cd = zero, zero, zero, zero, zero, zero
    dd, sc, sd, cz, dz = zero, zero, zero, zero, zero
    for k in range(count):
        ga, gb, gc, gd = weights[TO_A + k], weights[TO_B + k], weights[TO_C + k], weights[TO_D + k]
        by_c, by_d = information[k] * gc, information[k] * gd
        blur_cross = information[k] * weights[TO_BLUR + k] + FULL_DENSITY * (ga + gb) * bleed_cross[k]
        ac += ga * by_c
        ad += ga * by_d
        bc += gb * by_c
        bd += gb * by_d
        cc += gc * by_c
        cd += gc * by_d
        dd += gd * by_d
        sc += gc * projection[k]
        sd += gd * projection[k]
        cz += gc * blur_cross
        dz += gd * blur_cross
    sums[AC] += ac
    sums[AD] += ad
    sums[BC] += bc
    sums[BD] += bd
    sums[CC] += cc
    sums[CD] += cd
    sums[DD] += dd
    sums[C] += sc
    sums[D] += sd
    sums[C_BLUR] += cz
    sums[D_BLUR] += dz


@compiled
def fill_zeros(model, box):  # type: ignore[no-untyped-def]
    """Fill the box (x from, y from, x to, y to; px) of a float32 image with zeros."""
    for y in range(box[1], box[3]):
        model[y, box[0] : box[2]] = np.float32(0.0)


@compiled
def accumulate_residual_sums(view, model, drawn, sigma, box):  # type: ignore[no-untyped-def]
    """Sums over the pixels near each gridline.

    Args:
        view: ``PyramidLevel``.
        model: (H, W, 3) float32, the light of the drawn pattern over black.
        drawn: ``DrawnGridlines`` in the model.
        sigma: px, the blur.
        box: (4,) px, x from, y from, x to, y to: the drawn part of the image.

    Returns:
        (E, 24), the columns are named above. AA, AB, BB: squared derivatives of the drawing's values by the gridline's
        offset at both ends; A, B: derivative times residual (image less drawing, both as values); MISFIT: squared
        residual of PIXELS; BLUR: residual times the derivative by sigma; BLUR_CURVATURE,
        A_BLUR, B_BLUR: that derivative squared, and times those by the offsets. C and D are the same for the bending of
        gridlines that bend, 0 elsewhere.
    """
    sums = np.zeros((drawn.lines.shape[0], SUMS))
    first, rows = np.empty(CHUNK, np.int64), np.empty(4 * CHUNK, np.float32)
    residuals = allocate_residuals()
    buffers = RowBuffers(first, rows, np.empty(7 * CHUNK, np.float32), residuals)
    width = view.image.shape[1]
    start = 3 * (box[1] * width + box[0])
    image, light = view.image.reshape(-1)[start:], model.reshape(-1)[start:]
    _accumulate_gridline_sums(view, image, light, drawn, sigma, box, buffers, sums)
    return sums


@inlined_no_refcount
def _accumulate_gridline_sums(view, image, model, drawn, sigma, box, buffers, out):  # type: ignore[no-untyped-def]
    """Add the pixels of the box to the sums (E, 24) of all gridlines; image and model are flat and begin there."""
    lines, reach = drawn.lines, BAND * sigma
    width, encoded = view.image.shape[1], view.response.encoded
    rows, weights, residuals = buffers.rows, buffers.weights, buffers.residuals
    for e in range(lines.shape[0]):
        light = side_light(drawn.sides, drawn.added, e)
        strength = light.contrast0**2 + light.contrast1**2 + light.contrast2**2
        if lines[e, KNOWN] == 0.0 or strength == 0.0:
            continue
        frame, bleed = row_frame(lines, e, box, width), side_light(drawn.sides, drawn.bleed, e)
        line, p_end = pixel_geometry(frame, sigma), frame.p + frame.length * frame.up
        end_width = np.float32(END_BELL * sigma / frame.length)
        begin = max(int(np.ceil(min(frame.p, p_end) - reach)), 0)
        last = min(int(np.floor(max(frame.p, p_end) + reach)), frame.p_count - 1)
        half = reach / abs(frame.up)
        wide, most = row_sizes(half, frame.q_count)
        sums = out[e]
        for first in range(begin, last + 1, most):
            block = RowBlock(buffers.first, min(most, last + 1 - first), wide, frame.step_q)
            count = padded_count(block.row_count) * wide
            fill_rows(block, first, frame, half, rows)
            fill_weights(rows, block, line, np.float32(reach), end_width, weights)
            shares = weights[BEFORE_SHARE:]
            fill_residuals(image, model, encoded, block, light, shares, residuals)
            fill_bleed(light, bleed, shares, count, residuals)
            _accumulate_sums(residuals, weights, count, sums)
            if drawn.is_bending[e]:
                _accumulate_bending_sums(residuals, weights, count, sums)
        _update_units(sums, 1.0 / sigma)


@inlined_no_refcount
def _update_units(sums, inverse):  # type: ignore[no-untyped-def]
    """Multiply a gridline's sums (24,) by the powers of 1 / blur that they lack."""
    for k in (AA, AB, BB, BLUR_CURVATURE, A_BLUR, B_BLUR, C_BLUR, D_BLUR, AC, AD, BC, BD, CC, CD, DD):
        sums[k] *= inverse * inverse
    for k in (A, B, BLUR, C, D):
        sums[k] *= inverse
