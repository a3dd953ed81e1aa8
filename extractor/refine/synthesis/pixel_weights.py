"""The weights of the pixels near a gridline: close to the derivatives of the drawing by the offsets of its two ends."""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import inlined_no_refcount
from extractor.refine.synthesis.pixel_rows import ACROSS, ALONG, CHUNK, FROM, TO, padded_count

BAND = 2.2  # in units of the blur, the distance from a gridline within which pixels count
IN_BAND, TO_A, TO_B, TO_BLUR, TO_C, TO_D, BEFORE_SHARE = (
    k * CHUNK for k in range(7)
)  # columns of a pixel's weights


def _density_terms() -> tuple[np.float32, ...]:
    """The normal density as a polynomial in z^2, good to 2e-5 within the band."""
    z = np.linspace(0, BAND + 0.4, 200)
    polynomial = np.polynomial.Polynomial.fit(z * z, np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi), 5).convert()
    return tuple(np.float32(c) for c in polynomial.coef)


C0, C1, C2, C3, C4, C5 = _density_terms()
I1, I2, I3, I4, I5 = (np.float32(c / (2 * k + 3)) for k, c in enumerate((C1, C2, C3, C4, C5)))
# The normal distribution as a quintic from -1 to 1; 1 / END units of the blur reach to 1. Its derivative is
# P1 (1 - z^2)^2; END_BELL is the density at 0.
P1, P3, P5 = np.float32(15 / 16), np.float32(-5 / 8), np.float32(3 / 16)
END = np.float32(0.42)
END_BELL = 0.3989


@inlined_no_refcount
def _pixel_weights(along, across, line, end_width):  # type: ignore[no-untyped-def]
    """A pixel's distance from the gridline in units of the blur, the normal density there, and the derivatives of the
    gridline's offset at the pixel by the offsets of its start and end.

    ``along`` and ``across`` are the pixel's place, px; ``line`` is the ``PixelGeometry``; ``end_width`` is the width of
    the blurred ends, in units of the chord.
    """
    one, half = np.float32(1.0), np.float32(0.5)
    zero = np.float32(0.0)
    length, leave, arrive, inverse = line.length, line.leave, line.arrive, line.inverse_sigma
    t = along * line.inverse_length
    inside = min(max(t, zero), one)
    off = inside * (one - inside) * (leave * (one - inside) - arrive * inside)
    off += leave * min(t, zero) + arrive * max(t - one, zero)
    z = (across - length * off) * inverse
    zz = z * z
    g = max(C0 + zz * (C1 + zz * (C2 + zz * (C3 + zz * (C4 + zz * C5)))), zero)
    at_start = along * (inverse * END)
    start = min(max(at_start, -one), one)
    end = min(max(at_start - (length * inverse) * END, -one), one)
    ss, ee = start * start, end * end
    bell_s, bell_e = (one - ss) * (one - ss), (one - ee) * (one - ee)
    rise = half + start * (P1 + ss * (P3 + ss * P5))
    fall = half + end * (P1 + ee * (P3 + ee * P5))
    inner = rise - fall
    to_b = t * inner + end_width * (bell_s - bell_e)
    return z, g, inner - to_b, to_b


@inlined_no_refcount
def half_share(z):  # type: ignore[no-untyped-def]
    """The share of the light before a gridline, at the distance z beyond the gridline in units of the blur; good within
    the band."""
    zz = z * z
    return np.float32(0.5) - z * (C0 + zz * (I1 + zz * (I2 + zz * (I3 + zz * (I4 + zz * I5)))))


@inlined_no_refcount
def fill_weights(rows, block, line, reach, end_width, weights):  # type: ignore[no-untyped-def]
    """Fill in the weights of all pixels of the rows across a gridline, 0 beyond ``reach`` px.

    The weights are polynomials close to the derivative of the drawing: the normal density of the distance, and the
    blurred ends of 1 - t and t. Any weights give an unbiased gradient. Loops without branches and tables are fast.
    """
    zero, one, lanes = np.float32(0.0), np.float32(1.0), padded_count(block.row_count)
    for j in range(block.row_length):
        out, step = weights[j * lanes :], np.float32(j)
        for i in range(lanes):
            along, across = (
                rows[ALONG + i] + step * line.along_step,
                rows[ACROSS + i] + step * line.across_step,
            )
            within = (step >= rows[FROM + i]) & (step <= rows[TO + i])
            keep = one if within & (along >= -reach) & (along <= line.length + reach) else zero
            z, g, to_a, to_b = _pixel_weights(along, across, line, end_width)
            ga, gb = keep * g * to_a, keep * g * to_b
            gc = ga * to_b
            out[IN_BAND + i], out[TO_A + i], out[TO_B + i] = keep, ga, gb
            out[TO_BLUR + i] = z * (ga + gb)
            out[TO_C + i], out[TO_D + i] = gc, gc * (to_a - to_b)
            out[BEFORE_SHARE + i] = half_share(z)
