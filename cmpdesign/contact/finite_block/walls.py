"""The change of a layer's response by the free walls of a block.

The block and the layer without end are solved in the same splines, and only the difference of both is used: near a load
the splines are too coarse, but there both responses have the same error. The exact response of the layer without end
(``elastic_layer.patch_response``) is added by ``green_matrix``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.finite_block.dissection import dissection_order
from cmpdesign.contact.finite_block.splines import SUPPORT, ThicknessBasis, axis_over
from cmpdesign.contact.finite_block.stiffness import block_stiffness, wave_stiffness
from cmpdesign.libraries import extra

with extra("evaluate"):
    import scipy.sparse as sp
    from scipy.fft import irfft2, next_fast_len, rfft2
    from scipy.sparse.linalg import splu

Array = NDArray[np.float64]
# Poisson's ratio of both spline solutions at most: beyond it splines of this degree are too stiff.
LARGEST_POISSON = 0.49
STEP_PER_THICKNESS, MAX_SPANS = 0.3, 40  # knot span; spans along the longer side at most
POLYNOMIALS = 5
REACH_THICKNESSES = 2.5  # of the layer without end beyond the outline, before it repeats
CHUNK = 150  # right-hand sides at once


class WallResponse:
    """Displacement by loads on the block minus that by the same loads on the layer without end, for 1 MPa.

    Args:
        elastomer: the layer, with any modulus.
        outline_mm: (K, 2) the block's outline.
        points_mm: (M, 2) points at the elastomer's marker depth.
    """

    def __init__(self, elastomer: Elastomer, outline_mm: Array, points_mm: Array) -> None:
        h = elastomer.thickness_mm
        low, high = outline_mm.min(axis=0), outline_mm.max(axis=0)
        step = max(STEP_PER_THICKNESS * h, float((high - low).max()) / MAX_SPANS)
        self._x, self._y = (axis_over(low[k], high[k], step) for k in (0, 1))
        z = ThicknessBasis(h, POLYNOMIALS)
        (at_x, weight_x), (at_y, weight_y) = self._x.quadrature(), self._y.quadrature()
        self._places = at_x.ravel(), at_y.ravel()
        grid = np.stack(np.meshgrid(*self._places), axis=-1)
        self._weight = np.outer(weight_y.ravel(), weight_x.ravel())
        self._inside = inside_outline(outline_mm, grid.reshape(-1, 2)).reshape(self._weight.shape)
        poisson = min(elastomer.poisson, LARGEST_POISSON)
        shear = 0.5 / (1 + poisson)
        elastic = shear, 2 * shear * poisson / (1 - 2 * poisson)
        self._seen = _kron_rows(self._y.at(points_mm[:, 1])[0], self._x.at(points_mm[:, 0])[0])
        through = z.at(np.full(1, elastomer.marker_depth_mm))[0][0]
        self._walled = self._solve_block(z, elastic, through)
        self._endless = self._solve_layer(z, elastic, through, REACH_THICKNESSES * h)

    def matrix(self, centres_mm: Array, width_mm: float) -> Array:
        """(3 M, 3 K) mm/MPa by loads exp(-r^2 / 2 width^2) at centres (K, 2); the block's ends at the outline."""
        everywhere, within = self._loads(centres_mm, width_mm)
        points = len(self._seen)
        change = np.empty((points, 3, len(centres_mm), 3))
        for j in range(3):
            for i in range(3):
                change[:, i, :, j] = (within.T @ self._walled[:, i, :, j].T).T
                change[:, i, :, j] -= (everywhere.T @ self._endless[:, i, :, j].T).T
        return change.reshape(3 * points, -1)

    def _loads(self, centres_mm: Array, width_mm: float) -> tuple[sp.csc_matrix, sp.csc_matrix]:
        """The loads' products with the columns, (columns, K): without the outline, and inside it."""
        x, y = self._places
        nx, ny = self._x.at(x)[0], self._y.at(y)[0]
        parts: tuple[list[Array], list[Array]] = ([], [])
        for centre in centres_mm:
            load = np.outer(
                *(np.exp(-0.5 * ((at - c) / width_mm) ** 2) for at, c in ((y, centre[1]), (x, centre[0])))
            )
            for kept, weight in zip(parts, (self._weight, self._weight * self._inside), strict=True):
                kept.append(sp.csr_matrix((ny.T @ (weight * load) @ nx).reshape(1, -1)))
        everywhere, within = (sp.vstack(kept).T.tocsc() for kept in parts)
        return everywhere, within

    def _solve_block(self, z: ThicknessBasis, elastic: tuple[float, float], through: Array) -> Array:
        """Displacement of the touched face's columns for unit forces at the points, (M, 3, columns, 3)."""
        points, columns = self._seen.shape
        stiffness = block_stiffness(self._x, self._y, z, self._inside, elastic)
        used = np.flatnonzero(stiffness.diagonal()[:: 3 * z.count] > 0)
        reached = self._reached()
        used = np.intersect1d(used, np.flatnonzero(reached))
        places = np.stack(np.unravel_index(used, (self._y.count, self._x.count)), axis=1)
        used = used[dissection_order(places, SUPPORT - 1)]
        unknowns = (3 * z.count * used[:, None] + np.arange(3 * z.count)).ravel()
        factors = splu(
            stiffness[unknowns][:, unknowns].tocsc(),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        answer = np.zeros((points, 3, columns, 3))
        for start in range(0, points, CHUNK // 3):
            seen = self._seen[start : start + CHUNK // 3, used]
            force = np.einsum("mc,k,ij->ckjmi", seen, through, np.eye(3)).reshape(len(unknowns), -1)
            moved = factors.solve(force).reshape(len(used), z.count, 3, -1, 3).sum(axis=1)
            answer[start : start + CHUNK // 3, :, used] = np.moveaxis(moved, 0, 0).transpose(2, 3, 0, 1)
        return answer

    def _reached(self) -> NDArray[np.bool_]:
        """The columns with a part inside the outline."""
        x, y = self._places
        overlap = self._y.at(y)[0].T @ (self._weight * self._inside) @ self._x.at(x)[0]
        return np.asarray(overlap.ravel() > 0)

    def _solve_layer(
        self, z: ThicknessBasis, elastic: tuple[float, float], through: Array, reach_mm: float
    ) -> Array:
        """As ``_solve_block``, of the layer without end."""
        points = len(self._seen)
        rows, columns = self._y.count, self._x.count
        ny, nx = (next_fast_len(n + int(np.ceil(2 * reach_mm / self._x.step_mm))) for n in (rows, columns))
        half = nx // 2 + 1
        waves = wave_stiffness((ny, nx), self._x.step_mm, z, elastic)[:, :half]
        unit = np.kron(through[:, None], np.eye(3))
        symbol = np.linalg.solve(waves, unit).reshape(ny, half, z.count, 3, 3).sum(axis=2)  # (ny, half, j, i)
        padded = np.zeros((points, ny, nx))
        padded[:, :rows, :columns] = self._seen.reshape(points, rows, columns)
        spectrum = rfft2(padded)
        answer = np.empty((points, 3, rows * columns, 3))
        for i in range(3):
            for j in range(3):
                moved = irfft2(spectrum * symbol[..., j, i], (ny, nx))[:, :rows, :columns]
                answer[:, i, :, j] = moved.reshape(points, -1)
        return answer


def inside_outline(outline_mm: Array, points_mm: Array) -> Array:
    """(N,) 1.0 for points (N, 2) inside a closed outline (K, 2), else 0.0 (even and odd crossings)."""
    x, y = points_mm.T
    odd = np.zeros(len(points_mm), np.bool_)
    for (x0, y0), (x1, y1) in zip(outline_mm, np.roll(outline_mm, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        odd ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0 if y1 != y0 else 1.0) + x0)
    return odd.astype(np.float64)


def _kron_rows(first: Array, second: Array) -> Array:
    """(N, a b): the products of every row of (N, a) and (N, b)."""
    return np.asarray((first[:, :, None] * second[:, None, :]).reshape(len(first), -1))
