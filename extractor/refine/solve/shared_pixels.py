"""The pixels near a marker, which the gridlines that meet there share.

The derivatives by two gridlines with the directions a and b overlap by the integrals of
t^i u^j exp(-|t a - u b|^2 / 4 s^2) / 4 pi s^2 over the two rays, which have closed forms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

MIN_ANGLE = 0.4  # rad; the closed forms hold for long gridlines, which two at a smaller angle are not. Chosen
DEGREE = 8  # of the polynomials; the native code has room for as many coefficients


def _closed_forms() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Coefficients of r a and r^3 b as polynomials in r = sqrt(1 - cosine), accurate to 1e-7.

    With s the sine and p the angle between one gridline and the continuation of the other, a = p / s is the integral
    for i = j = 0 and b = (s + p cosine) / s^3 that for i = j = 1.
    """
    r = np.linspace(np.sqrt(1 - np.cos(MIN_ANGLE)), np.sqrt(2 - 1e-3), 400)
    cosine = 1 - r * r
    s, p = np.sqrt(1 - cosine * cosine), np.pi - np.arccos(cosine)
    forms = r * p / s, r**3 * (s + p * cosine) / s**3
    first, second = (
        tuple(float(c) for c in np.polynomial.Polynomial.fit(r, form, DEGREE).convert().coef)
        for form in forms
    )
    return first, second


PLAIN_FORM, LINEAR_FORM = _closed_forms()


class SharedPixelLimits(NamedTuple):
    """Limits of shared pixels, and the closed forms between them.

    Attributes:
        max_cosine: of the angle between two gridlines, as which a smaller angle counts. Derived from ``MIN_ANGLE``.
        min_end_information: least share of a gridline's information that is left where its ends are blurred. Chosen.
        min_uncut_information: squared gray levels per px^2; the least information of a whole gridline by which is
            divided. Derived: it only keeps a division from failing.
        plain_form, linear_form: coefficients of r a and of r^3 b. Derived by ``_closed_forms``.
    """

    max_cosine: float = float(np.cos(MIN_ANGLE))
    min_end_information: float = 0.75
    min_uncut_information: float = 1e-12
    plain_form: tuple[float, ...] = PLAIN_FORM
    linear_form: tuple[float, ...] = LINEAR_FORM


LIMITS = SharedPixelLimits()
