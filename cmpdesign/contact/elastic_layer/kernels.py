"""Compliance of a bonded layer at one wave number: surface displacement over surface traction.

At the wave vector k, with L along k, S across it in the plane and z out of the surface:

    u_z = C_zz t_z - i C_xz t_L        u_L = C_LL t_L + i C_xz t_z        u_S = C_SH t_S

The layer's plane-strain solution, four coefficients fixed by u = 0 at the support and the traction at the surface, has
with a = kh, c = 3 - 4 nu and D = c cosh 2a + 2a^2 + 5 - 12 nu + 8 nu^2 the closed form

    C_zz = (1 - nu) (c sinh 2a - 2a) / (mu k D)        C_LL = (1 - nu) (c sinh 2a + 2a) / (mu k D)
    C_xz = (a^2 - (1 - 2 nu) c sinh^2 a) / (mu k D)     C_SH = tanh(a) / (mu k)

which is continuous in nu up to 1/2. All is written over exp(2a) / 2, so that nothing overflows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastomer import Elastomer

Array = NDArray[np.float64]
SERIES_LIMIT = 0.5


class LayerCompliances(NamedTuple):
    """Displacement over traction in mm/MPa, each shaped as the wave numbers."""

    zz: Array
    xz: Array
    ll: Array
    sh: Array


def layer_compliances(k_per_mm: Array, elastomer: Elastomer) -> LayerCompliances:
    """The four compliances at wave numbers >= 0 in rad/mm, of any shape; k = 0 gives the limit."""
    h, nu = elastomer.thickness_mm, elastomer.poisson
    a = np.asarray(k_per_mm, dtype=np.float64) * h
    # At k = 0 any positive number serves: the limits are put in below.
    a = np.where(a == 0, 1.0, a)
    decay = np.exp(-2 * a)
    c = 3 - 4 * nu
    denominator = c * (1 + decay**2) + 2 * decay * (2 * a**2 + 5 - 12 * nu + 8 * nu**2)
    scale = h / (elastomer.shear_mpa * a * denominator)
    # c sinh x - x = c (sinh x - x) + (2 - 4 nu) x: two terms that are never negative, nothing cancels.
    zz = (1 - nu) * scale * (c * _scaled_sinh_minus_x(2 * a) + 2 * decay * (2 - 4 * nu) * 2 * a)
    ll = (1 - nu) * scale * (-c * np.expm1(-4 * a) + 2 * decay * 2 * a)
    xz = scale * (2 * decay * a**2 - (1 - 2 * nu) * c * 0.5 * np.expm1(-2 * a) ** 2)
    sh = h * np.tanh(a) / (elastomer.shear_mpa * a)
    still = np.asarray(k_per_mm) == 0
    uniform = h / elastomer.shear_mpa
    return LayerCompliances(
        zz=np.where(still, uniform * (1 - 2 * nu) / (2 * (1 - nu)), zz),
        xz=np.where(still, 0.0, xz),
        ll=np.where(still, uniform, ll),
        sh=np.where(still, uniform, sh),
    )


def _scaled_sinh_minus_x(x: Array) -> Array:
    """2 exp(-x) (sinh x - x), by its series where the difference would cancel."""
    small = np.minimum(x, SERIES_LIMIT)
    y = small * small
    tail = 1 + y / 20 * (1 + y / 42 * (1 + y / 72 * (1 + y / 110 * (1 + y / 156))))
    series = np.exp(-small) * small * y / 3 * tail
    return np.where(x < SERIES_LIMIT, series, -np.expm1(-2 * x) - 2 * x * np.exp(-x))
