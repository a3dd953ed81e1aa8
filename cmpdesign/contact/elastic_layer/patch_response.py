"""Displacement of the elastic layer under a load with a Gaussian profile, by the distance from its centre.

The layer's compliances (``kernels``) depend on the wave number alone. Integrating the waves over their directions
leaves Bessel functions. P(k) = 2 pi s^2 exp(-k^2 s^2 / 2) is the spectrum of a load exp(-r^2 / 2 s^2). With L along the
line from the load's centre to the point and S across it:

    u_z = t_z Z0 + t_L Z1       u_L = t_L (L0 - L2) - t_z X1       u_S = t_S (L0 + L2)

    Z0 = int C_zz P J0(kr)      Z1 = int C_zx P J1(kr)      X1 = int C_xz P J1(kr)
    L0 = int (C_LL + C_SH) / 2 P J0(kr)                      L2 = int (C_LL - C_SH) / 2 P J2(kr)

where int stands for the integral over k from 0 of k dk / 2 pi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.green import KERNEL_REACH_THICKNESSES
from cmpdesign.contact.elastic_layer.kernels import interior_compliances, layer_compliances
from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.libraries import extra

Array = NDArray[np.float64]
WAVE_REACH = 7.0  # in units of 1 / s, the largest wave number; P is 2e-11 of its largest value there
TURN_NODES = 8  # of a Gauss-Legendre rule for each period of the Bessel functions at the largest distance
STEPS_PER_WIDTH = 16  # distances of the tables per width s, between which cubics interpolate
PATCH_REACH = 5.0  # in units of s, beyond which a load has no traction


@dataclass(frozen=True, eq=False)
class PatchResponse:
    """The functions Z0, Z1, X1, L0 and L2 of the module at one depth, in mm for a peak traction of 1 MPa.

    Attributes:
        distance_mm: (n,) of the tables.
        tables: (5, n) in the order above; 0 beyond the largest distance.
    """

    distance_mm: Array
    tables: Array

    def matrix(self, points_mm: Array, centres_mm: Array) -> Array:
        """(3 N, 3 K) mm/MPa: displacement x, y, z of points (N, 2) by the peak tractions x, y, z of loads at (K, 2)."""
        with extra("evaluate"):
            from scipy.interpolate import CubicSpline

        offset = points_mm[:, None] - centres_mm[None]
        distance = np.hypot(offset[..., 0], offset[..., 1])
        values = CubicSpline(self.distance_mm, self.tables, axis=1)(distance)
        z0, z1, x1, l0, l2 = np.where(distance <= self.distance_mm[-1], values, 0.0)
        unit = offset / np.where(distance > 0, distance, 1.0)[..., None]
        blocks = np.empty((len(points_mm), 3, len(centres_mm), 3))
        for a in range(2):
            for b in range(2):
                same = 1.0 if a == b else 0.0
                blocks[:, a, :, b] = same * (l0 + l2) - 2.0 * l2 * unit[..., a] * unit[..., b]
            blocks[:, a, :, 2] = -x1 * unit[..., a]
            blocks[:, 2, :, a] = z1 * unit[..., a]
        blocks[:, 2, :, 2] = z0
        return blocks.reshape(3 * len(points_mm), -1)


def patch_response(elastomer: Elastomer, width_mm: float, depth_mm: float, reach_mm: float) -> PatchResponse:
    """The response to a load exp(-r^2 / 2 width^2) at a depth below the surface, for distances up to ``reach_mm``.

    Beyond ``KERNEL_REACH_THICKNESSES`` the layer does not respond, and the tables end.
    """
    with extra("evaluate"):
        from scipy.special import j0, j1, jv

    reach_mm = min(reach_mm, KERNEL_REACH_THICKNESSES * elastomer.thickness_mm + PATCH_REACH * width_mm)
    largest = WAVE_REACH / width_mm
    panels = int(np.ceil(2 + largest * reach_mm / (2 * np.pi)))
    nodes, weights = np.polynomial.legendre.leggauss(TURN_NODES)
    k = (largest / panels * (np.arange(panels)[:, None] + 0.5 * (nodes + 1))).ravel()
    weights = np.tile(weights, panels) / panels
    c = layer_compliances(k, elastomer) if depth_mm == 0 else interior_compliances(k, elastomer, depth_mm)
    weight = 0.5 * largest * weights * k * width_mm**2 * np.exp(-0.5 * (k * width_mm) ** 2)
    r = np.linspace(0.0, reach_mm, int(np.ceil(STEPS_PER_WIDTH * reach_mm / width_mm)) + 2)
    kr = np.outer(r, k)
    bessel0, bessel1, bessel2 = j0(kr), j1(kr), jv(2, kr)
    tables = [
        bessel0 @ (weight * c.zz),
        bessel1 @ (weight * c.zx),
        bessel1 @ (weight * c.xz),
        bessel0 @ (weight * (c.ll + c.sh) / 2),
        bessel2 @ (weight * (c.ll - c.sh) / 2),
    ]
    return PatchResponse(r, np.stack(tables))
