"""Compliance of a bonded elastic layer at one wave number: surface displacement over surface traction.

At the wave vector k, with L along k, S across it in the plane and z out of the surface:

    u_z = C_zz t_z - i C_xz t_L        u_L = C_LL t_L + i C_xz t_z        u_S = C_SH t_S

The plane-strain solution of the elastic layer has four coefficients, fixed by u = 0 at the support and the traction at
the surface. With a = kh, c = 3 - 4 nu and D = c cosh 2a + 2a^2 + 5 - 12 nu + 8 nu^2 its closed form is

    C_zz = (1 - nu) (c sinh 2a - 2a) / (mu k D)        C_LL = (1 - nu) (c sinh 2a + 2a) / (mu k D)
    C_xz = (a^2 - (1 - 2 nu) c sinh^2 a) / (mu k D)     C_SH = tanh(a) / (mu k)

It is continuous in nu up to 1/2. Numerators and denominators are divided by exp(2a) / 2 to avoid overflow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastomer import Elastomer

Array = NDArray[np.float64]
SERIES_LIMIT = 0.5  # argument below which the series of sinh x - x is used


class LayerCompliances(NamedTuple):
    """Displacement over traction in mm/MPa, float64 arrays of the wave numbers' shape; see the module."""

    zz: Array
    xz: Array
    ll: Array
    sh: Array


def layer_compliances(k_per_mm: Array, elastomer: Elastomer) -> LayerCompliances:
    """The four compliances at wave numbers >= 0 in rad/mm, of any shape. At k = 0 they are the limits."""
    h, nu = elastomer.thickness_mm, elastomer.poisson
    a = np.asarray(k_per_mm, dtype=np.float64) * h
    # At k = 0 any positive number is valid, because the limits replace the result below.
    a = np.where(a == 0, 1.0, a)
    decay = np.exp(-2 * a)
    c = 3 - 4 * nu
    denominator = c * (1 + decay**2) + 2 * decay * (2 * a**2 + 5 - 12 * nu + 8 * nu**2)
    scale = h / (elastomer.shear_mpa * a * denominator)
    # c sinh x - x = c (sinh x - x) + (2 - 4 nu) x: both terms are never negative, so there is no cancellation.
    zz = (1 - nu) * scale * (c * _scaled_sinh_minus_x(2 * a) + 2 * decay * (2 - 4 * nu) * 2 * a)
    ll = (1 - nu) * scale * (-c * np.expm1(-4 * a) + 2 * decay * 2 * a)
    xz = scale * (2 * decay * a**2 - (1 - 2 * nu) * c * 0.5 * np.expm1(-2 * a) ** 2)
    sh = h * np.tanh(a) / (elastomer.shear_mpa * a)
    is_uniform = np.asarray(k_per_mm) == 0
    uniform_compliance = h / elastomer.shear_mpa
    return LayerCompliances(
        zz=np.where(is_uniform, uniform_compliance * (1 - 2 * nu) / (2 * (1 - nu)), zz),
        xz=np.where(is_uniform, 0.0, xz),
        ll=np.where(is_uniform, uniform_compliance, ll),
        sh=np.where(is_uniform, uniform_compliance, sh),
    )


def _scaled_sinh_minus_x(x: Array) -> Array:
    """2 exp(-x) (sinh x - x), by its series below ``SERIES_LIMIT``, where the difference cancels."""
    small = np.minimum(x, SERIES_LIMIT)
    y = small * small
    tail = 1 + y / 20 * (1 + y / 42 * (1 + y / 72 * (1 + y / 110 * (1 + y / 156))))
    series = np.exp(-small) * small * y / 3 * tail
    return np.where(x < SERIES_LIMIT, series, -np.expm1(-2 * x) - 2 * x * np.exp(-x))
