"""The normal distribution, and how much of a blurred half plane or wedge a pixel sees.

Lengths are in units of the blur. Where a pixel lies h inside one side of a wedge and k inside the other, its share of
the wedge is how often two normal deviates, correlated by r, lie below h and k: r is the cosine between the directions
in which the sides are walked along, one after the other. That is N(h) N(k) where these are at right angles, and
changes with r as the density of both does (Drezner and Wesolowsky 1990):

    share = N(h) N(k) + integral from 0 to r of exp(-(h^2 + k^2 - 2 h k s) / 2 (1 - s^2)) / 2 pi sqrt(1 - s^2) ds.

With s = 2 u / (1 + u^2) the integrand is smooth enough for a Gaussian rule of three nodes.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import inlined_no_refcount

NORMAL_REACH = 3.3  # a side farther away than this is not seen
GAUSS_NODES = np.polynomial.legendre.leggauss(
    3
)  # good to 6e-5 for wedges of 30 to 150 degrees, 3e-4 for 20 to 160
CORNER_TERMS = 9  # numbers: for each node the factors of h^2 + k^2 and of h k, and its weight
EXP_POWER = 16  # of a cubic is the exponential
MAX_EXPONENT = 12.0  # exp(-12) is nothing


def _normal_coefficients() -> tuple[np.float32, ...]:
    """The normal distribution less a half over z, by z^2, as a polynomial good to 3e-6 as far as ``NORMAL_REACH``."""
    from scipy.special import ndtr

    z = NORMAL_REACH * np.sin(np.linspace(1e-3, np.pi / 2, 3000))
    square = 2 * (z / NORMAL_REACH) ** 2 - 1
    terms = np.polynomial.chebyshev.chebvander(square, 7) * z[:, None]
    fit = np.polynomial.Chebyshev(
        np.linalg.lstsq(terms, ndtr(z) - 0.5, rcond=None)[0], domain=[0, NORMAL_REACH**2]
    )
    return tuple(np.float32(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


def _exp_coefficients() -> tuple[np.float32, ...]:
    """exp(-x) up to a sixteenth of ``MAX_EXPONENT``, as a cubic whose power is good to 1e-5."""
    x = np.linspace(0.0, MAX_EXPONENT / EXP_POWER, 2000)
    # an error counts as much as the rest of the power makes of it
    weight = np.exp(-(EXP_POWER - 1) * x)
    terms = np.vander(x, 4, increasing=True)
    fit = np.linalg.lstsq(terms * weight[:, None], np.exp(-x) * weight, rcond=None)[0]
    return tuple(np.float32(c) for c in fit)


N0, N1, N2, N3, N4, N5, N6, N7 = _normal_coefficients()
E0, E1, E2, E3 = _exp_coefficients()
EXP_END = np.float32(MAX_EXPONENT / EXP_POWER)
HALF = np.float32(0.5)


@inlined_no_refcount
def normal_cdf(z):  # type: ignore[no-untyped-def]
    """The normal distribution of a float32 as far as ``NORMAL_REACH`` to both sides."""
    zz = z * z
    return HALF + z * (N0 + zz * (N1 + zz * (N2 + zz * (N3 + zz * (N4 + zz * (N5 + zz * (N6 + zz * N7)))))))


@inlined_no_refcount
def fill_corner_terms(r, out):  # type: ignore[no-untyped-def]
    """Fill in what ``wedge_correlation`` needs of a corner (9,) float32, by the cosine between its sides'
    directions."""
    end = r / (1.0 + np.sqrt(max(1.0 - r * r, 0.0)))
    for i in range(3):
        u = 0.5 * end * (1.0 + GAUSS_NODES[0][i])
        more, less = 1.0 + u * u, 1.0 - u * u
        steep = more / (less * less * EXP_POWER)
        out[i], out[3 + i] = 0.5 * more * steep, 2.0 * u * steep
        out[6 + i] = GAUSS_NODES[1][i] * end / (2.0 * np.pi * more)


@inlined_no_refcount
def _exp_minus_16x(x):  # type: ignore[no-untyped-def]
    """exp(-16 x) of a float32, x not below 0."""
    x = min(x, EXP_END)
    e = E0 + x * (E1 + x * (E2 + x * E3))
    e = e * e
    e = e * e
    e = e * e
    return e * e


@inlined_no_refcount
def wedge_correlation(squares, product, corner):  # type: ignore[no-untyped-def]
    """A wedge's share beyond the product of its sides' by h^2 + k^2 and h k, and nine numbers of its corner."""
    a0, a1, a2, b0, b1, b2, w0, w1, w2 = corner
    share = w0 * _exp_minus_16x(a0 * squares - b0 * product)
    share += w1 * _exp_minus_16x(a1 * squares - b1 * product)
    return share + w2 * _exp_minus_16x(a2 * squares - b2 * product)
