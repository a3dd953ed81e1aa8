"""Strain at the surface, and the limit of linear theory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastomer import Elastomer

Array = NDArray[np.float64]
# At this strain the displacement of a neo-Hookean layer differs from linear theory by 5 %, and a compressed block is
# 12 % stiffer.
LINEAR_STRAIN_LIMIT = 0.1


def surface_strain(
    elastomer: Elastomer, displacement_mm: Array, traction_mpa: Array, step_mm: float
) -> Array:
    """(ny, nx): the largest absolute principal strain of every cell.

    In-plane strain is the gradient of the displacement (3, ny, nx) in mm. The other components follow from the traction
    (3, ny, nx) in MPa by Hooke's law.
    """
    mu, nu = elastomer.shear_mpa, elastomer.poisson
    ux_y, ux_x = np.gradient(displacement_mm[0], step_mm)
    uy_y, uy_x = np.gradient(displacement_mm[1], step_mm)
    strain = np.empty((*traction_mpa.shape[1:], 3, 3))
    strain[..., 0, 0], strain[..., 1, 1] = ux_x, uy_y
    strain[..., 0, 1] = strain[..., 1, 0] = (ux_y + uy_x) / 2
    strain[..., 0, 2] = strain[..., 2, 0] = traction_mpa[0] / (2 * mu)
    strain[..., 1, 2] = strain[..., 2, 1] = traction_mpa[1] / (2 * mu)
    strain[..., 2, 2] = ((1 - 2 * nu) / (2 * mu) * traction_mpa[2] - nu * (ux_x + uy_y)) / (1 - nu)
    return np.asarray(np.abs(np.linalg.eigvalsh(strain)).max(axis=-1))


def largest_strain(
    elastomer: Elastomer, displacement_mm: Array, traction_mpa: Array, step_mm: float
) -> float:
    """The larger of the largest surface strain and the deepest point over the thickness."""
    surface = surface_strain(elastomer, displacement_mm, traction_mpa, step_mm).max()
    return float(max(surface, -displacement_mm[2].min() / elastomer.thickness_mm))
