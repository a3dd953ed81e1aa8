"""The residual, image minus drawn pattern (``pattern_drawing``), summed along the gridlines.

The weight of a pixel is the derivative of the drawing by the gridline's offset. That derivative falls towards the
gridline's two ends as 1 - t and t. The sums are the gradient of the log-likelihood and its curvature.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined_no_refcount, vectorized_no_refcount
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y
from extractor.refine.synthesis.pixel_rows import (
    CHUNK,
    Color,
    RowBlock,
    fill_projections_and_squares,
    fill_rows,
    padded_count,
    pixel_geometry,
    row_frame,
    row_sizes,
)
from extractor.refine.synthesis.pixel_weights import (
    BAND,
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
AA, AB, BB, A, B, SHARE_A, SHARE_B, MISFIT, PIXELS, BLUR, BLUR_CURVATURE = range(11)
AC, AD, BC, BD, CC, CD, DD, C, D, SHARE_C, SHARE_D = range(11, 22)
READ_AA, READ_BB = 22, 23  # AA and BB as read, where bending is eliminated from them
SUMS = 24


class DrawnGridlines(NamedTuple):
    """Gridlines as they are drawn.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        contrasts: (E, 3) gray levels, the level on the side of (uy, -ux) less that on the side of (-uy, ux).
        black: (E, 3) gray levels, the black under the middles of the chords.
        is_bending: (E,) bool, gridlines with two more unknowns for their bending.
    """

    lines: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    black: NDArray[np.float64]
    is_bending: NDArray[np.bool_]


class RowBuffers(NamedTuple):
    """Memory for the pixels of one gridline.

    Attributes:
        first: (n,) int64, the first pixels of the rows. rows: their columns. weights: six columns of the pixels.
        projections: (n,) the residual along the contrast. squares: (n,) its square over all channels.
    """

    first: NDArray[np.int64]
    rows: NDArray[np.float32]
    weights: NDArray[np.float32]
    projections: NDArray[np.float32]
    squares: NDArray[np.float32]


@compiled
def fill_zeros(model, box):  # type: ignore[no-untyped-def]
    """Fill the box (x from, y from, x to, y to; px) of a float32 image with zeros."""
    for y in range(box[1], box[3]):
        model[y, box[0] : box[2]] = np.float32(0.0)


@compiled
def update_known_contrasts(lines, xy, cells, edge_cells, levels, slopes):  # type: ignore[no-untyped-def]
    """The contrasts across the gridlines.

    Args:
        lines: (E, 8), as ``gridlines`` gives them; ``KNOWN`` is set to 0 beside cells with an unknown corner.
        xy: (M, 2) px, the markers.
        cells: (K, 3) marker ids of the drawn cells.
        edge_cells: (E, 2) the drawn cells on both sides, -1 for none.
        levels: (K, 3) gray levels over black at the centroids.
        slopes: (K, 3, 2) gray levels per px along x and y.

    Returns:
        (E, 3) gray levels: at the chord's middle on the side of (uy, -ux) less on the side of (-uy, ux).
    """
    out = np.zeros((lines.shape[0], 3))
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] == 0.0:
            continue
        ux, uy, half = lines[e, UX], lines[e, UY], 0.5 * lines[e, LENGTH]
        mx, my = lines[e, X] + half * ux, lines[e, Y] + half * uy
        for k in range(2):
            i = edge_cells[e, k]
            if i < 0:
                continue
            a, b, c = cells[i, 0], cells[i, 1], cells[i, 2]
            cx, cy = (xy[a, 0] + xy[b, 0] + xy[c, 0]) / 3, (xy[a, 1] + xy[b, 1] + xy[c, 1]) / 3
            if not np.isfinite(cx):
                # a cell with an unknown corner is not drawn, and no gridline beside that cell is read
                out[e] = 0.0
                lines[e, KNOWN] = 0.0
                break
            sign = -1.0 if (cy - my) * ux - (cx - mx) * uy > 0.0 else 1.0
            for channel in range(3):
                level = (
                    levels[i, channel] + slopes[i, channel, 0] * (mx - cx) + slopes[i, channel, 1] * (my - cy)
                )
                out[e, channel] += sign * level
    return out


@vectorized_no_refcount
def _accumulate_sums(residual, squares, weights, count, sums):  # type: ignore[no-untyped-def]
    """Add ``count`` pixels to a gridline's sums (24,)."""
    zero = np.float32(0.0)
    blur, curvature, misfit, pixels, wa, wb = zero, zero, zero, zero, zero, zero
    # in float64 the order of summing hardly changes the sums that move the markers
    double = np.float64(0.0)
    aa, ab, bb, sa, sb = double, double, double, double, double
    for k in range(count):
        ga, gb, gz = weights[TO_A + k], weights[TO_B + k], weights[TO_BLUR + k]
        aa += ga * ga
        ab += ga * gb
        bb += gb * gb
        sa += ga * residual[k]
        sb += gb * residual[k]
        wa += ga
        wb += gb
        blur += residual[k] * gz
        curvature += gz * gz
        misfit += weights[IN_BAND + k] * squares[k]
        pixels += weights[IN_BAND + k]
    sums[AA] += aa
    sums[AB] += ab
    sums[BB] += bb
    sums[A] += sa
    sums[B] += sb
    sums[SHARE_A] += wa
    sums[SHARE_B] += wb
    sums[BLUR] += blur
    sums[BLUR_CURVATURE] += curvature
    sums[MISFIT] += misfit
    sums[PIXELS] += pixels


@vectorized_no_refcount
def _accumulate_bending_sums(residual, weights, count, sums):  # type: ignore[no-untyped-def]
    """The same for the gridline's bending, with the weights t (1 - t) and t (1 - t) (1 - 2 t)."""
    zero = np.float32(0.0)
    ac, ad, bc, bd, cc, cd = zero, zero, zero, zero, zero, zero
    dd, sc, sd, wc, wd = zero, zero, zero, zero, zero
    for k in range(count):
        ga, gb, gc, gd = weights[TO_A + k], weights[TO_B + k], weights[TO_C + k], weights[TO_D + k]
        ac += ga * gc
        ad += ga * gd
        bc += gb * gc
        bd += gb * gd
        cc += gc * gc
        cd += gc * gd
        dd += gd * gd
        sc += gc * residual[k]
        sd += gd * residual[k]
        wc += gc
        wd += gd
    sums[AC] += ac
    sums[AD] += ad
    sums[BC] += bc
    sums[BD] += bd
    sums[CC] += cc
    sums[CD] += cd
    sums[DD] += dd
    sums[C] += sc
    sums[D] += sd
    sums[SHARE_C] += wc
    sums[SHARE_D] += wd


@compiled
def _band_box(lines, reach, box):  # type: ignore[no-untyped-def]
    """The part of the box (x from, y from, x to, y to; px) that holds the bands of all known gridlines."""
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] != 0.0:
            # a gridline bows by its length times its slopes over 4, at most
            wide = 2.0 * reach + lines[e, LENGTH] * max(abs(lines[e, LEAVE]), abs(lines[e, ARRIVE]))
            x, y = lines[e, X], lines[e, Y]
            end_x, end_y = x + lines[e, LENGTH] * lines[e, UX], y + lines[e, LENGTH] * lines[e, UY]
            low_x, high_x = min(low_x, min(x, end_x) - wide), max(high_x, max(x, end_x) + wide)
            low_y, high_y = min(low_y, min(y, end_y) - wide), max(high_y, max(y, end_y) + wide)
    if not low_x <= high_x:
        return box[0], box[1], box[0], box[1]
    return (
        max(box[0], min(int(low_x), box[2])),
        max(box[1], min(int(low_y), box[3])),
        min(box[2], max(int(high_x) + 2, box[0])),
        min(box[3], max(int(high_y) + 2, box[1])),
    )


@vectorized_no_refcount
def _fill_residual(image, model, area, residual):  # type: ignore[no-untyped-def]
    """Fill the flat ``residual`` with image - model within the area."""
    width = 3 * (area[2] - area[0])
    for y in range(area[1], area[3]):
        observed = image[y].reshape(-1)[3 * area[0] : 3 * area[2]]
        drawn = model[y].reshape(-1)[3 * area[0] : 3 * area[2]]
        own = residual[(y - area[1]) * width :]
        for k in range(observed.shape[0]):
            own[k] = np.float32(observed[k]) - drawn[k]


@compiled
def accumulate_residual_sums(image, model, drawn, sigma, box, residual):  # type: ignore[no-untyped-def]
    """Sums over the pixels near each gridline.

    Args:
        image: (H, W, 3) uint8.
        model: (H, W, 3) float32, the pattern over black.
        drawn: ``DrawnGridlines`` in the model.
        sigma: px, the blur.
        box: (4,) px, x from, y from, x to, y to: the drawn part of the image.
        residual: (H * W * 3,) float32, overwritten with image - model.

    Returns:
        (E, 24), the columns are named above. AA, AB, BB: squared derivatives of the drawing by the gridline's offset
        at both ends; A, B: derivative times residual (image - model - black, the last at the gridline's middle); SHARE:
        derivative times the share of a side, per unit of contrast; MISFIT: squared residual of PIXELS; BLUR: residual
        times the derivative by sigma. C and D are the same for the bending of gridlines that bend, 0 elsewhere.
    """
    sums = np.zeros((drawn.lines.shape[0], SUMS))
    area = _band_box(drawn.lines, BAND * sigma, box)
    _fill_residual(image, model, area, residual)
    first, rows = np.empty(CHUNK, np.int64), np.empty(4 * CHUNK, np.float32)
    projections, squares = np.zeros(CHUNK, np.float32), np.zeros(CHUNK, np.float32)
    buffers = RowBuffers(first, rows, np.empty(6 * CHUNK, np.float32), projections, squares)
    _accumulate_gridline_sums(residual, area, drawn, sigma, buffers, sums)
    return sums


@inlined_no_refcount
def _accumulate_gridline_sums(residual, area, drawn, sigma, buffers, out):  # type: ignore[no-untyped-def]
    """Add the residual within the area to the sums (E, 24) of all gridlines."""
    lines, contrasts, black, reach = drawn.lines, drawn.contrasts, drawn.black, BAND * sigma
    rows, weights, projections, squares = (
        buffers.rows,
        buffers.weights,
        buffers.projections,
        buffers.squares,
    )
    width, height = area[2] - area[0], area[3] - area[1]
    for e in range(lines.shape[0]):
        color = Color(np.float32(contrasts[e, 0]), np.float32(contrasts[e, 1]), np.float32(contrasts[e, 2]))
        strength = color.red * color.red + color.green * color.green + color.blue * color.blue
        if lines[e, KNOWN] == 0.0 or strength == 0.0:
            continue
        background = Color(np.float32(black[e, 0]), np.float32(black[e, 1]), np.float32(black[e, 2]))
        frame = row_frame(lines, e, area[0], area[1], width, height)
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
            fill_projections_and_squares(residual, block, color, background, projections, squares)
            fill_weights(rows, block, line, np.float32(reach), end_width, weights)
            _accumulate_sums(projections, squares, weights, count, sums)
            if drawn.is_bending[e]:
                _accumulate_bending_sums(projections, weights, count, sums)
        _update_units(sums, strength, 1.0 / sigma)


@inlined_no_refcount
def _update_units(sums, strength, inverse):  # type: ignore[no-untyped-def]
    """Multiply a gridline's sums (24,) by the powers of its squared contrast and of 1 / blur that they lack."""
    for k in (AA, AB, BB, BLUR_CURVATURE, AC, AD, BC, BD, CC, CD, DD):
        sums[k] *= strength * inverse * inverse
    for k in (A, B, BLUR, C, D):
        sums[k] *= inverse
    for k in (SHARE_A, SHARE_B, SHARE_C, SHARE_D):
        sums[k] *= 0.5 * inverse
