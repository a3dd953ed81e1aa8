"""The stiffness of a block in splines (x, y) and polynomials (z), and of the same layer without end.

Unknowns are ordered by column (one product of two splines), polynomial, direction. The stiffness of an isotropic solid
consists of products T_pq of the derivative p of a test function and q of a trial function: K_ij = lambda T_ij +
mu T_ji + mu delta_ij sum T_pp (Zienkiewicz and Taylor 2000, 4.2). T is a Kronecker product of a matrix of columns and
one through the thickness. Where the outline cuts a knot span, integrals are sums over its points inside; the span's
part outside keeps ``ERSATZ`` of the stiffness (the finite cell method, Parvizian 2007), so that no unknown is free.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.finite_block.splines import SUPPORT, SplineAxis, ThicknessBasis
from cmpdesign.libraries import extra

with extra("evaluate"):
    import scipy.sparse as sp

Array = NDArray[np.float64]
ERSATZ = 1e-4
AXES = (
    "x0",
    "y0",
    "0z",
)  # of a derivative by x, y, z: the part along the face, the part through the thickness


def _elastic(product: Callable[[str, str], Any], shear: float, lame: float) -> list[list[Any]]:
    """The blocks K_ij from products of derivatives."""
    plain = product("x0", "x0") + product("y0", "y0") + product("0z", "0z")
    return [
        [
            lame * product(AXES[i], AXES[j]) + shear * product(AXES[j], AXES[i]) + (i == j) * shear * plain
            for j in range(3)
        ]
        for i in range(3)
    ]


def block_stiffness(
    x: SplineAxis, y: SplineAxis, z: ThicknessBasis, inside: Array, elastic: tuple[float, float]
) -> sp.csr_matrix:
    """The block's stiffness, (n, n).

    Args:
        x, y, z: the basis.
        inside: of the points of quadrature (y, x) of the outline, 1 inside and 0 outside.
        elastic: mu and lambda, MPa.
    """
    (at_x, weight_x), (at_y, weight_y) = x.quadrature(), y.quadrature()
    sides = [[sp.csr_matrix(part) for part in axis.at(at.ravel())] for axis, at in ((x, at_x), (y, at_y))]
    (nx, dx), (ny, dy) = sides
    values = {"0": sp.kron(ny, nx, "csr"), "x": sp.kron(ny, dx, "csr"), "y": sp.kron(dy, nx, "csr")}
    weight = np.outer(weight_y.ravel(), weight_x.ravel()) * np.where(inside > 0, inside, ERSATZ)
    scale = sp.diags(weight.ravel())
    columns = {a + b: (values[a].T @ scale @ values[b]).tocsr() for a in values for b in values}
    through = z.products()

    def product(test: str, trial: str) -> Any:
        return sp.kron(columns[test[0] + trial[0]], through[test[1] + trial[1]], "csr")

    blocks = _elastic(product, *elastic)
    size = columns["00"].shape[0] * z.count
    total = sp.csr_matrix((3 * size, 3 * size))
    for i in range(3):
        for j in range(3):
            unit = sp.csr_matrix(([1.0], ([i], [j])), (3, 3))
            total = total + sp.kron(blocks[i][j], unit, "csr")
    return total.tocsr()


def wave_stiffness(
    count: tuple[int, int], step_mm: float, z: ThicknessBasis, elastic: tuple[float, float]
) -> Array:
    """The stiffness of the periodic layer at every wave of a grid of (ny, nx) columns, (ny, nx, n, n) complex.

    n = 3 polynomials, ordered by polynomial and direction.
    """
    axis = SplineAxis(0.0, step_mm, 2 * SUPPORT - 1)
    at, weight = axis.quadrature()
    value, slope = axis.at(at.ravel())
    middle = SUPPORT - 1
    parts = {"0": value, "d": slope}
    symbols: dict[str, list[Array]] = {}
    for a in parts:
        for b in parts:
            # of the middle spline with its neighbours
            row = (weight.ravel() * parts[a][:, middle]) @ parts[b]
            for side, n in enumerate(count):
                turn = np.exp(-2j * np.pi * np.outer(np.fft.fftfreq(n), np.arange(len(row)) - middle))
                symbols.setdefault(a + b, [np.empty(0)] * 2)[side] = turn.conj() @ row
    through = z.products()

    def column(test: str, trial: str) -> Array:
        along_y = symbols[("d" if test == "y" else "0") + ("d" if trial == "y" else "0")][0]
        along_x = symbols[("d" if test == "x" else "0") + ("d" if trial == "x" else "0")][1]
        return np.asarray(np.outer(along_y, along_x))

    def product(test: str, trial: str) -> Any:
        return column(test[0], trial[0])[..., None, None] * through[test[1] + trial[1]]

    blocks = np.array(_elastic(product, *elastic))  # (3, 3, ny, nx, k, k)
    total = np.moveaxis(blocks, (0, 1), (3, 5))  # (ny, nx, k, i, k, j)
    return np.asarray(total.reshape(*count, 3 * z.count, 3 * z.count))
