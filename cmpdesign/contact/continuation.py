"""From the displacement of the pattern, which cameras see, to that of the touched surface above it.

The elastic layer is loaded at its surface only. Loads with Gaussian profiles on a grid over the pattern, with unknown
tractions, move both the pattern and the surface (``elastic_layer.patch_response``). The tractions are taken as
independent normal deviates of one standard deviation, which is estimated from the pattern's displacement by maximum
likelihood; the surface's displacement is then the mean of a normal distribution, whose covariance contains the noise
and the layer's decay (Rasmussen and Williams 2006, eq. 2.25, 2.26 and 5.8).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.patch_response import patch_response
from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.errors import require
from cmpdesign.libraries import extra

Array = NDArray[np.float64]
# Distance of loads, in units of the distance of neighbouring markers. Coarser loads understate the uncertainty at an
# edge.
LOAD_SPACING = 0.4
LOAD_WIDTH = 0.8  # in units of the spacing of the loads; their sum is then uniform to 1 %
LOAD_MARGIN = 1.5  # in units of the distance of neighbouring markers, of loads beyond the pattern
MAX_MARKERS = 1500  # of one pattern: the equations are dense, three a marker


@dataclass(frozen=True, eq=False)
class ContinuedSurface:
    """The touched surface above the markers; NaN where the marker's displacement is unknown.

    Attributes:
        displacement_mm: (M, 3) float64.
        cov_mm2: (M, 3, 3) float64.
    """

    displacement_mm: Array
    cov_mm2: Array


class SurfaceContinuation:
    """Continues displacements of one pattern to the touched surface.

    Args:
        elastomer: the layer; ``marker_depth_mm`` is the pattern's depth. Young's modulus has no influence.
        xy_mm: (M, 2) the markers of the flat pattern.
        spacing_mm: the distance of neighbouring markers.

    Raises:
        ContactError: more than ``MAX_MARKERS`` markers.
    """

    def __init__(self, elastomer: Elastomer, xy_mm: Array, spacing_mm: float) -> None:
        require(len(xy_mm) <= MAX_MARKERS, "markers", len(xy_mm), f"at most {MAX_MARKERS}")
        loads = _load_grid(xy_mm, LOAD_SPACING * spacing_mm, LOAD_MARGIN * spacing_mm)
        reach = float(np.linalg.norm(np.ptp(np.concatenate([xy_mm, loads]), axis=0)))
        width = LOAD_WIDTH * LOAD_SPACING * spacing_mm
        layer = Elastomer(elastomer.thickness_mm, 1.0, elastomer.poisson)
        seen = patch_response(layer, width, elastomer.marker_depth_mm, reach).matrix(xy_mm, loads)
        touched = patch_response(layer, width, 0.0, reach).matrix(xy_mm, loads)
        self._seen, self._across, self._touched = seen @ seen.T, touched @ seen.T, touched @ touched.T

    def __call__(self, displacement_mm: Array, cov_mm2: Array) -> ContinuedSurface:
        """The surface for displacements (M, 3) of the markers with covariances (M, 3, 3); NaN where unknown."""
        known = np.flatnonzero(np.isfinite(displacement_mm).all(axis=1))
        result = ContinuedSurface(np.full_like(displacement_mm, np.nan), np.full_like(cov_mm2, np.nan))
        if not len(known):
            return result
        rows = (3 * known[:, None] + np.arange(3)).ravel()
        values = displacement_mm[known].ravel()
        noise = _block_diagonal(cov_mm2[known])
        seen, across = self._seen[np.ix_(rows, rows)], self._across[np.ix_(rows, rows)]
        variance = _likeliest_variance(seen, noise, values)
        factor = np.linalg.cholesky(variance * seen + noise)
        half = np.linalg.solve(factor, variance * across.T)
        mean = half.T @ np.linalg.solve(factor, values)
        touched = variance * np.stack([self._touched[3 * m : 3 * m + 3, 3 * m : 3 * m + 3] for m in known])
        explained = np.einsum("rmi,rmj->mij", *2 * (half.reshape(len(rows), -1, 3),))
        result.displacement_mm[known] = mean.reshape(-1, 3)
        result.cov_mm2[known] = touched - explained
        return result


def _load_grid(xy_mm: Array, spacing_mm: float, margin_mm: float) -> Array:
    """(K, 2) points of a square grid that lie within the margin of a marker."""
    with extra("evaluate"):
        from scipy.spatial import cKDTree

    low, high = xy_mm.min(axis=0) - margin_mm, xy_mm.max(axis=0) + margin_mm
    counts = np.ceil((high - low) / spacing_mm).astype(int)
    axes = [
        0.5 * (a + b) + spacing_mm * (np.arange(n + 1) - n / 2)
        for a, b, n in zip(low, high, counts, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return np.asarray(grid[cKDTree(xy_mm).query(grid)[0] <= margin_mm])


def _block_diagonal(blocks: Array) -> Array:
    """(3 N, 3 N) from (N, 3, 3)."""
    count = len(blocks)
    matrix = np.zeros((count, 3, count, 3))
    matrix[np.arange(count), :, np.arange(count)] = blocks
    return matrix.reshape(3 * count, -1)


def _likeliest_variance(seen: Array, noise: Array, values: Array) -> float:
    """The variance of the tractions under which the values are likeliest."""
    with extra("evaluate"):
        from scipy.linalg import eigh
        from scipy.optimize import minimize_scalar

    # one eigendecomposition makes all candidates diagonal
    scale, vectors = eigh(seen, noise)
    scale = np.maximum(scale, 0.0)
    projected = (vectors.T @ values) ** 2

    def cost(log_variance: float) -> float:
        spread = np.exp(log_variance) * scale + 1.0
        return float((projected / spread + np.log(spread)).sum())

    # from tractions below the noise to tractions above all values
    high = np.log(max(float(projected.sum()), 1.0) / scale.max())
    low = np.log(1e-6 / scale.max())
    best = minimize_scalar(cost, bounds=(low, high + 12.0), method="bounded")
    return float(np.exp(best.x))
