"""Compliance of a bonded elastic layer at one wave number: displacement over surface traction.

At the wave vector k, with L along k, S across it in the plane and z out of the surface:

    u_z = C_zz t_z - i C_xz t_L        u_L = C_LL t_L + i C_xz t_z        u_S = C_SH t_S

The plane-strain solution of the elastic layer has four coefficients, fixed by u = 0 at the support and the traction at
the surface. With a = kh, c = 3 - 4 nu and D = c cosh 2a + 2a^2 + 5 - 12 nu + 8 nu^2 its closed form is

    C_zz = (1 - nu) (c sinh 2a - 2a) / (mu k D)        C_LL = (1 - nu) (c sinh 2a + 2a) / (mu k D)
    C_xz = (a^2 - (1 - 2 nu) c sinh^2 a) / (mu k D)     C_SH = tanh(a) / (mu k)

This form is continuous in nu up to 1/2. Numerators and denominators are divided by exp(2a) / 2 to avoid overflow.

At a depth d below the surface u_z for t_L has a compliance of its own, u_z = C_zz t_z - i C_zx t_L. With Papkovich's
and Neuber's potentials 2 mu u = grad(phi + s psi) - 4 (1 - nu) psi e_z at the height s above the support, u = 0 at
s = 0 leaves two coefficients A and B, and with x = k s

    2 mu u_L = i (A (c sinh x + x cosh x) + B x sinh x)        2 mu u_z = A x sinh x + B (x cosh x - c sinh x)

The traction at x = a fixes them. With p = 1 - 2 nu, q = 2 (1 - nu) and x = k (h - d) the compliances times mu k D are

    zz: -a x sinh(a - x) + (ac - px) sinh a sinh x - q cosh a (x cosh x - c sinh x)
    ll: -a x sinh(a - x) - (ac - px) sinh a sinh x + q cosh a (x cosh x + c sinh x)
    xz:  a x cosh(a - x) + (ac - qx) cosh a sinh x - p x sinh a cosh x - pc sinh a sinh x
    zx:  a x cosh(a - x) - (ac - qx) cosh a sinh x + p x sinh a cosh x - pc sinh a sinh x

and C_SH = sinh(x) / (mu k cosh a). At d = 0 they are those above, at d = h all are 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastomer import Elastomer

Array = NDArray[np.float64]
SERIES_LIMIT = 0.5  # argument below which the series of sinh x - x is used


class LayerCompliances(NamedTuple):
    """Displacement over traction in mm/MPa, float64 arrays of the wave numbers' shape; see the module.

    At the surface ``zx`` is ``xz``.
    """

    zz: Array
    xz: Array
    zx: Array
    ll: Array
    sh: Array


def layer_compliances(k_per_mm: Array, elastomer: Elastomer) -> LayerCompliances:
    """The surface's compliances at wave numbers >= 0 in rad/mm, of any shape. At k = 0 they are the limits."""
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
    coupling = np.where(is_uniform, 0.0, xz)
    return LayerCompliances(
        zz=np.where(is_uniform, uniform_compliance * (1 - 2 * nu) / (2 * (1 - nu)), zz),
        xz=coupling,
        zx=coupling,
        ll=np.where(is_uniform, uniform_compliance, ll),
        sh=np.where(is_uniform, uniform_compliance, sh),
    )


def interior_compliances(k_per_mm: Array, elastomer: Elastomer, depth_mm: float) -> LayerCompliances:
    """The compliances at a depth below the surface, 0 to the thickness, at wave numbers >= 0 in rad/mm, of any shape.

    Products of two hyperbolic functions are multiplied by 4 exp(-a - x), D is divided by exp(2a) / 2.
    """
    h, nu, mu = elastomer.thickness_mm, elastomer.poisson, elastomer.shear_mpa
    p, q, c = 1 - 2 * nu, 2 * (1 - nu), 3 - 4 * nu
    is_uniform = np.asarray(k_per_mm) == 0
    a = np.where(is_uniform, 1.0, np.asarray(k_per_mm, dtype=np.float64) * h)
    x = a * (1 - depth_mm / h)
    at_surface, at_depth = np.exp(-2 * a), np.exp(-2 * x)
    sinh_a, cosh_a, sinh_x, cosh_x = 1 - at_surface, 1 + at_surface, -np.expm1(-2 * x), 1 + at_depth
    sinh_between, cosh_between = 2 * (at_depth - at_surface), 2 * (at_depth + at_surface)
    denominator = c * (1 + at_surface**2) + 2 * at_surface * (2 * a**2 + 5 - 12 * nu + 8 * nu**2)
    scale = h / (mu * a) * np.exp(x - a) / (2 * denominator)
    # x cosh x - c sinh x, of which x cosh x - sinh x cancels for small x.
    bending = _scaled_x_cosh_minus_sinh(x) - 2 * p * sinh_x
    normal = -a * x * sinh_between
    across = (a * c - p * x) * sinh_a * sinh_x
    coupled = a * x * cosh_between - p * c * sinh_a * sinh_x
    turned = (a * c - q * x) * cosh_a * sinh_x - p * x * sinh_a * cosh_x
    uniform = (h - depth_mm) / mu
    return LayerCompliances(
        zz=np.where(is_uniform, uniform * p / q, scale * (normal + across - q * cosh_a * bending)),
        xz=np.where(is_uniform, 0.0, scale * (coupled + turned)),
        zx=np.where(is_uniform, 0.0, scale * (coupled - turned)),
        ll=np.where(is_uniform, uniform, scale * (normal - across + q * cosh_a * (x * cosh_x + c * sinh_x))),
        sh=np.where(is_uniform, uniform, h / (mu * a) * np.exp(x - a) * sinh_x / cosh_a),
    )


def _scaled_x_cosh_minus_sinh(x: Array) -> Array:
    """2 exp(-x) (x cosh x - sinh x), by its series below ``SERIES_LIMIT``, where the difference cancels."""
    small = np.minimum(x, SERIES_LIMIT)
    y = small * small
    tail = 1 + y / 10 * (1 + y / 28 * (1 + y / 54 * (1 + y / 88 * (1 + y / 130))))
    series = np.exp(-small) * 2 * small * y / 3 * tail
    return np.asarray(np.where(x < SERIES_LIMIT, series, x * (1 + np.exp(-2 * x)) + np.expm1(-2 * x)))


def _scaled_sinh_minus_x(x: Array) -> Array:
    """2 exp(-x) (sinh x - x), by its series below ``SERIES_LIMIT``, where the difference cancels."""
    small = np.minimum(x, SERIES_LIMIT)
    y = small * small
    tail = 1 + y / 20 * (1 + y / 42 * (1 + y / 72 * (1 + y / 110 * (1 + y / 156))))
    series = np.exp(-small) * small * y / 3 * tail
    return np.where(x < SERIES_LIMIT, series, -np.expm1(-2 * x) - 2 * x * np.exp(-x))
