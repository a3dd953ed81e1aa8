"""The normal distribution, and the coverage of a pixel by a blurred half plane or wedge.

Lengths are in units of the blur. For a pixel at the distance h inside one side of a wedge and k inside the other, the
coverage is the probability that two normal deviates of correlation r lie below h and k. r is the cosine between the
directions of the sides, both along the wedge's outline. At right angles the coverage is N(h) N(k); its derivative with
respect to r is the bivariate density (Drezner and Wesolowsky 1990):

    share = N(h) N(k) + integral from 0 to r of exp(-(h^2 + k^2 - 2 h k s) / 2 (1 - s^2)) / 2 pi sqrt(1 - s^2) ds.

With s = 2 u / (1 + u^2) the integrand is smooth enough for a Gauss-Legendre rule of three nodes.
"""

from __future__ import annotations

import numpy as np

from extractor.numeric.compilation import inlined_no_refcount

NORMAL_REACH = 3.3  # in units of the blur; a side farther away has no influence
GAUSS_NODES = np.polynomial.legendre.leggauss(
    3
)  # error 6e-5 for wedges of 30 to 150 degrees, 3e-4 for 20 to 160
CORNER_TERMS = 9  # of a corner: three factors of h^2 + k^2, three of h k, three weights, one per node
EXP_POWER = 16  # the exponential is this power of a cubic
MAX_EXPONENT = 12.0  # exp(-12) counts as 0


def _normal_coefficients() -> tuple[np.float32, ...]:
    """The polynomial in z^2 for (N(z) - 0.5) / z, with an error of 3e-6 up to ``NORMAL_REACH``."""
    from scipy.special import ndtr

    z = NORMAL_REACH * np.sin(np.linspace(1e-3, np.pi / 2, 3000))
    square = 2 * (z / NORMAL_REACH) ** 2 - 1
    terms = np.polynomial.chebyshev.chebvander(square, 7) * z[:, None]
    fit = np.polynomial.Chebyshev(
        np.linalg.lstsq(terms, ndtr(z) - 0.5, rcond=None)[0], domain=[0, NORMAL_REACH**2]
    )
    return tuple(np.float32(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


def _exp_coefficients() -> tuple[np.float32, ...]:
    """The cubic for exp(-x) up to ``MAX_EXPONENT`` / ``EXP_POWER``, whose power has an error of 1e-5."""
    x = np.linspace(0.0, MAX_EXPONENT / EXP_POWER, 2000)
    # the power multiplies an error by the other factors
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
    """The normal distribution of a float32 z, abs(z) <= ``NORMAL_REACH``."""
    zz = z * z
    return HALF + z * (N0 + zz * (N1 + zz * (N2 + zz * (N3 + zz * (N4 + zz * (N5 + zz * (N6 + zz * N7)))))))


@inlined_no_refcount
def fill_corner_terms(r, out):  # type: ignore[no-untyped-def]
    """Write the terms (``CORNER_TERMS``,) float32 of a corner for ``wedge_correlation``.

    ``r`` is the cosine between the directions of its sides.
    """
    end = r / (1.0 + np.sqrt(max(1.0 - r * r, 0.0)))
    for i in range(3):
        u = 0.5 * end * (1.0 + GAUSS_NODES[0][i])
        more, less = 1.0 + u * u, 1.0 - u * u
        steep = more / (less * less * EXP_POWER)
        out[i], out[3 + i] = 0.5 * more * steep, 2.0 * u * steep
        out[6 + i] = GAUSS_NODES[1][i] * end / (2.0 * np.pi * more)


@inlined_no_refcount
def _exp_minus_16x(x):  # type: ignore[no-untyped-def]
    """exp(-16 x) of a float32 x >= 0."""
    x = min(x, EXP_END)
    e = E0 + x * (E1 + x * (E2 + x * E3))
    e = e * e
    e = e * e
    e = e * e
    return e * e


@inlined_no_refcount
def wedge_correlation(squares, product, corner):  # type: ignore[no-untyped-def]
    """The coverage by a wedge minus the product N(h) N(k) of its sides, float32.

    Args:
        squares: h^2 + k^2; product: h k.
        corner: tuple of the nine terms of ``fill_corner_terms``, in this order.
    """
    coverage = corner[6] * _exp_minus_16x(corner[0] * squares - corner[3] * product)
    coverage += corner[7] * _exp_minus_16x(corner[1] * squares - corner[4] * product)
    return coverage + corner[8] * _exp_minus_16x(corner[2] * squares - corner[5] * product)
