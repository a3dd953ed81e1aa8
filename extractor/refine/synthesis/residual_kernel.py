"""What the image shows beyond the pattern as it is drawn (``painting``) is read along the gridlines.

Every pixel near a gridline votes with the derivative of the drawing by the gridline's offset, which sinks towards
its two ends as 1 - t and t: the gradient of the log-likelihood, and its curvature.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.numeric.compilation import compiled, inlined_no_refcount, vectorized_no_refcount
from extractor.refine.synthesis.gridlines import ARRIVE, KNOWN, LEAVE, LENGTH, UX, UY, X, Y
from extractor.refine.synthesis.pixel_rows import (
    ALONG,
    ASIDE,
    CHUNK,
    FROM,
    TO,
    fill_projections_and_squares,
    fill_rows,
    padded_count,
    row_sizes,
)

BAND = 2.2  # how far from a gridline its pixels vote, in units of the blur

# columns of what is read along a gridline: sums over its pixels
AA, AB, BB, A, B, SHARE_A, SHARE_B, MISFIT, PIXELS, BLUR, BLUR_CURVATURE = range(11)
AC, AD, BC, BD, CC, CD, DD, C, D, SHARE_C, SHARE_D = range(11, 22)
READ_AA, READ_BB = 22, 23  # AA and BB as they were read, where bending is eliminated from them
SUMS = 24
KEEP, TO_A, TO_B, TO_BLUR, TO_C, TO_D = (k * CHUNK for k in range(6))  # weights of pixels


def _density_terms() -> tuple[np.float32, ...]:
    """The normal density by z^2, as a polynomial good to 2e-5 as far as pixels vote."""
    z = np.linspace(0, BAND + 0.4, 200)
    fit = np.polynomial.Polynomial.fit(z * z, np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi), 5).convert()
    return tuple(np.float32(c) for c in fit.coef)


C0, C1, C2, C3, C4, C5 = _density_terms()
# The normal distribution as a quintic from -1 to 1, END to a unit of the blur; its derivative is P1 (1 - z^2)^2.
P1, P3, P5 = np.float32(15 / 16), np.float32(-5 / 8), np.float32(3 / 16)
END = np.float32(0.42)
END_BELL = 0.3989


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
    """Zeros inside the box (x from, y from, x to, y to)."""
    for y in range(box[1], box[3]):
        model[y, box[0] : box[2]] = np.float32(0.0)


@compiled
def update_known_contrasts(lines, xy, cells, edge_cells, levels, slopes):  # type: ignore[no-untyped-def]
    """(E, 3): level at the gridline's middle on the side of (uy, -ux) less that on the side of (-uy, ux)."""
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
                # half of it is out of sight; it cannot be drawn, so its sides cannot be read
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


@inlined_no_refcount
def _pixel_weights(along, aside, inverse, short, slack, length, leave, arrive):  # type: ignore[no-untyped-def]
    """A pixel's distance from the gridline in units of the blur, the normal density there, and the derivatives of the
    gridline's place by those of its start and end."""
    one, half = np.float32(1.0), np.float32(0.5)
    zero = np.float32(0.0)
    t = along * short
    inside = min(max(t, zero), one)
    off = inside * (one - inside) * (leave * (one - inside) - arrive * inside)
    off += leave * min(t, zero) + arrive * max(t - one, zero)
    z = (aside - length * off) * inverse
    zz = z * z
    g = max(C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))), zero)
    at_start = along * (inverse * END)
    start = min(max(at_start, -one), one)
    end = min(max(at_start - (length * inverse) * END, -one), one)
    ss, ee = start * start, end * end
    bell_s, bell_e = (one - ss) * (one - ss), (one - ee) * (one - ee)
    rise = half + start * (P1 + ss * (P3 + ss * P5))
    fall = half + end * (P1 + ee * (P3 + ee * P5))
    whole = rise - fall
    to_b = t * whole + slack * (bell_s - bell_e)
    return z, g, whole - to_b, to_b


@inlined_no_refcount
def _fill_weights(rows, lanes, wide, du, dv, reach, inverse, short, slack, length, leave, arrive, weights):  # type: ignore[no-untyped-def]
    """Fill in the weights of all pixels of the rows across a gridline, 0 where they lie beyond the band.

    They are polynomials close to the derivative of the drawing, the normal density by its distance and the blurred
    ends of 1 - t and t: any weights give unbiased votes, and loops without branches and tables are fast.
    """
    zero, one = np.float32(0.0), np.float32(1.0)
    for j in range(wide):
        out, step = weights[j * lanes :], np.float32(j)
        for i in range(lanes):
            along, aside = rows[ALONG + i] + step * du, rows[ASIDE + i] + step * dv
            within = (step >= rows[FROM + i]) & (step <= rows[TO + i])
            keep = one if within & (along >= -reach) & (along <= length + reach) else zero
            z, g, to_a, to_b = _pixel_weights(along, aside, inverse, short, slack, length, leave, arrive)
            ga, gb = keep * g * to_a, keep * g * to_b
            gc = ga * to_b
            out[KEEP + i], out[TO_A + i], out[TO_B + i] = keep, ga, gb
            out[TO_BLUR + i] = z * (ga + gb)
            out[TO_C + i], out[TO_D + i] = gc, gc * (to_a - to_b)


@vectorized_no_refcount
def _accumulate_sums(rest, squares, weights, count, sums):  # type: ignore[no-untyped-def]
    """Add ``count`` pixels to a gridline's sums."""
    zero = np.float32(0.0)
    blur, curvature, misfit, pixels, wa, wb = zero, zero, zero, zero, zero, zero
    # what moves the markers is summed so that the order of summing hardly matters
    fine = np.float64(0.0)
    aa, ab, bb, sa, sb = fine, fine, fine, fine, fine
    for k in range(count):
        ga, gb, gz = weights[TO_A + k], weights[TO_B + k], weights[TO_BLUR + k]
        aa += ga * ga
        ab += ga * gb
        bb += gb * gb
        sa += ga * rest[k]
        sb += gb * rest[k]
        wa += ga
        wb += gb
        blur += rest[k] * gz
        curvature += gz * gz
        misfit += weights[KEEP + k] * squares[k]
        pixels += weights[KEEP + k]
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
def _accumulate_bending_sums(rest, weights, count, sums):  # type: ignore[no-untyped-def]
    """The same for a gridline's bending, with weights t (1 - t) and t (1 - t) (1 - 2 t)."""
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
        sc += gc * rest[k]
        sd += gd * rest[k]
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
    """The part of the box (x from, y from, x to, y to) that the bands along known gridlines lie in."""
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for e in range(lines.shape[0]):
        if lines[e, KNOWN] != 0.0:
            # a band may be bowed by as much as its length, times its slopes, over 4
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
    """Write image - model within the area into the flat ``residual``."""
    width = 3 * (area[2] - area[0])
    for y in range(area[1], area[3]):
        seen = image[y].reshape(-1)[3 * area[0] : 3 * area[2]]
        drawn = model[y].reshape(-1)[3 * area[0] : 3 * area[2]]
        own = residual[(y - area[1]) * width :]
        for k in range(seen.shape[0]):
            own[k] = np.float32(seen[k]) - drawn[k]


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
    """Fill in the sums (E, 24) from the residual within the area."""
    lines, contrasts, black = drawn.lines, drawn.contrasts, drawn.black
    at, rows, weights = buffers.first, buffers.rows, buffers.weights
    rest, squares = buffers.projections, buffers.squares
    inverse, reach = 1.0 / sigma, BAND * sigma
    width, height = area[2] - area[0], area[3] - area[1]
    for e in range(lines.shape[0]):
        color = np.float32(contrasts[e, 0]), np.float32(contrasts[e, 1]), np.float32(contrasts[e, 2])
        strength = color[0] * color[0] + color[1] * color[1] + color[2] * color[2]
        if lines[e, KNOWN] == 0.0 or strength == 0.0:
            continue
        beneath = np.float32(black[e, 0]), np.float32(black[e, 1]), np.float32(black[e, 2])
        ux, uy, length = lines[e, UX], lines[e, UY], lines[e, LENGTH]
        x0, y0, leave, arrive = (
            lines[e, X] - area[0],
            lines[e, Y] - area[1],
            lines[e, LEAVE],
            lines[e, ARRIVE],
        )
        # columns of pixels are walked through where it runs along x rather than along y, else rows
        along_x = abs(ux) > abs(uy)
        p0, q0, up, uq = (x0, y0, ux, uy) if along_x else (y0, x0, uy, ux)
        p_end, q_end = (width, height) if along_x else (height, width)
        step_p, step_q = (3, 3 * width) if along_x else (3 * width, 3)
        first = max(int(np.ceil(min(p0, p0 + length * up) - reach)), 0)
        last = min(int(np.floor(max(p0, p0 + length * up) + reach)), p_end - 1)
        half = reach / abs(up)
        wide, most = row_sizes(half, q_end)
        sums, sense = out[e], 1.0 if along_x else -1.0
        small = np.float32(inverse), np.float32(1.0 / length), np.float32(END_BELL * sigma / length)
        shape = np.float32(length), np.float32(leave), np.float32(arrive)
        steps = np.float32(uq), np.float32(sense * up), np.float32(reach)
        line = (p0, q0, up, uq, length, leave, arrive, half)
        for begin in range(first, last + 1, most):
            count = min(most, last + 1 - begin)
            lanes = padded_count(count)
            fill_rows(begin, 1, count, *line, 0, q_end - 1, wide, step_p, step_q, at, rows)
            fill_projections_and_squares(residual, at, count, wide, step_q, color, beneath, rest, squares)
            _fill_weights(rows, lanes, wide, *steps, *small, *shape, weights)
            _accumulate_sums(rest, squares, weights, lanes * wide, sums)
            if drawn.is_bending[e]:
                _accumulate_bending_sums(rest, weights, lanes * wide, sums)
        for k in (AA, AB, BB, BLUR_CURVATURE, AC, AD, BC, BD, CC, CD, DD):
            sums[k] *= strength * inverse * inverse
        for k in (A, B, BLUR, C, D):
            sums[k] *= inverse
        for k in (SHARE_A, SHARE_B, SHARE_C, SHARE_D):
            sums[k] *= 0.5 * inverse
