"""Tractions under which the markers move as measured: pressure is never negative, shear acts only where it presses.

Minimised is (d - A t)' W (d - A t) + |t|^2 / tau^2, with W the inverse covariance of the displacements d. The support,
the set of loads that press, is an active set (Lawson and Hanson 1974): loads whose pressure would be negative leave
it, loads at which the residual asks for pressure join it. The gain of a load is the decrease of the sum's root by this
load alone. It is compared with chi, the root mean square of the whitened residual, so that the model's own error does
not add stray loads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import contact as native
from extractor.contact.gel import Gel

Array = NDArray[np.float64]
Ids = NDArray[np.intp]


@dataclass(frozen=True)
class Limits:
    """Thresholds of the active set.

    Attributes:
        tau: standard deviation of the peak tractions before the measurement, in Young's moduli. Measured:
            python -m benchmarks.force, half or twice as much makes the force of a thin layer scatter more.
        gain_beside, gain_elsewhere: gain in units of chi above which a load beside the support, or elsewhere, is added.
            Chosen.
        rounds: additions to the support at most. Chosen.
        descents: steps of the projected gradient of a cold start. Chosen.
        seed_share: share of the largest pressure above which a load of the cold start belongs to the support. Chosen.
    """

    tau: float = 0.25
    gain_beside: float = 3.0
    gain_elsewhere: float = 12.0
    rounds: int = 12
    descents: int = 80
    seed_share: float = 0.08


LIMITS = Limits()


@dataclass(frozen=True, eq=False)
class Solution:
    """The tractions of the loads in the support.

    Attributes:
        support: (S,) ids of loads.
        traction: (S, 3) peak tractions in Young's moduli.
        inverse: (3 S, 3 S) their covariance by the noise, in squared Young's moduli.
        chi: root mean square of the whitened residual; at least 1.
        largest_gain: of all loads before any was in the support.
    """

    support: Ids
    traction: Array
    inverse: Array
    chi: float
    largest_gain: float


class Settled(NamedTuple):
    """Of the S given loads those that press, K.

    Attributes:
        kept: (K,) their places among the given ones.
        traction: (K, 3) in Young's moduli.
        inverse: (3 K, 3 K) their covariance by the noise.
        residual: (R,) whitened.
    """

    kept: Ids
    traction: Array
    inverse: Array
    residual: Array


class TractionSolver:
    """Solves for tractions in Young's moduli. It keeps no state between frames.

    Args:
        gel: the pad's Green's matrix.
        seen: (M, C, 3) derivatives of the C measured numbers of a marker by its displacement; None: the displacement.
        limits: thresholds.
    """

    def __init__(self, gel: Gel, seen: Array | None = None, limits: Limits = LIMITS) -> None:
        self._limits = limits
        markers, loads = gel.matrix.shape[0] // 3, len(gel.loads_mm)
        matrix = gel.matrix.reshape(markers, 3, loads * 3)
        if seen is not None:
            matrix = seen.astype(np.float32) @ matrix
        self._axes = matrix.shape[1]
        matrix = matrix.reshape(markers * self._axes, loads, 3)
        by_load = np.ascontiguousarray(matrix.transpose(1, 2, 0))
        self._by_load = by_load
        # pressure is minus the traction in z
        self._press = np.ascontiguousarray(-by_load[:, 2])
        self._squares = (self._press.reshape(loads, markers, -1).astype(np.float64) ** 2).sum(axis=1)
        self._neighbours = _neighbours(gel.loads_mm, gel.spacing_mm)
        self._coarse = _thinned(gel.loads_mm, gel.spacing_mm)
        coarse = self._press[self._coarse].astype(np.float64)
        self._coarse_gram = coarse @ coarse.T
        self._coarse_step = 1.0 / np.linalg.eigvalsh(self._coarse_gram)[-1]

    def solve(self, measured: Array, whitening: Array, start: Ids | None) -> Solution | None:
        """The tractions; None where nothing presses.

        Args:
            measured: (M, C) of the markers; 0 where unknown.
            whitening: (M, C, C) of which the transpose times itself is the inverse covariance; 0 where unknown.
            start: (S,) support of the frame before; None: a cold start.
        """
        white = np.einsum("mij,mj->mi", whitening, measured)
        known = max(3, int((np.abs(whitening).max(axis=(1, 2)) > 0).sum()) * self._axes)
        weight = np.einsum("mij,mij->j", whitening, whitening) / len(white)
        curvature = self._squares @ weight + self._limits.tau**-2
        gain = self._gains(white, whitening, curvature)
        largest = float(gain.max())
        if largest < self._limits.gain_elsewhere:
            return None
        support = self._cold_start(measured) if start is None or not len(start) else start
        tried = np.zeros(len(gain), np.bool_)
        for _ in range(self._limits.rounds):
            support, traction, inverse, residual = self._settle(white, whitening, support)
            chi = max(1.0, float(np.sqrt((residual**2).sum() / known)))
            gain = self._gains(residual, whitening, curvature)
            gain[support] = 0.0
            beside = np.zeros(len(gain) + 1, np.bool_)
            beside[self._neighbours[support].ravel()] = True
            limit = np.where(beside[:-1], self._limits.gain_beside, self._limits.gain_elsewhere)
            # a load joins once: one that left again would join and leave for ever
            wanted = (gain > chi * limit) & ~tried
            tried |= wanted
            stray = self._strays(support, traction, inverse, chi)
            if not wanted.any() and not stray.any():
                break
            support = np.union1d(support[~stray], np.flatnonzero(wanted))
        else:
            support, traction, inverse, residual = self._settle(white, whitening, support)
        return Solution(support, traction, inverse, chi, largest) if len(support) else None

    def _strays(self, support: Ids, traction: Array, inverse: Array, chi: float) -> NDArray[np.bool_]:
        """(S,) the loads of connected parts that explain less than a load elsewhere would have to.

        The largest part stays.
        """
        parts = _connected(support, self._neighbours)
        stray = np.zeros(len(support), np.bool_)
        if parts.max(initial=0) == 0:
            return stray
        gains = []
        for part in range(int(parts.max(initial=-1)) + 1):
            rows = 3 * np.flatnonzero(parts == part) + 2
            pressure = traction.reshape(-1)[rows]
            gains.append(float(np.sqrt(pressure @ np.linalg.solve(inverse[np.ix_(rows, rows)], pressure))))
        for part, gain in enumerate(gains):
            if gain < max(gains) and gain < self._limits.gain_elsewhere * chi:
                stray |= parts == part
        return stray

    def _gains(self, white: Array, whitening: Array, curvature: Array) -> Array:
        """(K,) the decrease of the sum's root by one more load's pressure; 0 where a suction would decrease it."""
        back = np.einsum("mij,mi->mj", whitening, white).reshape(-1).astype(np.float32)
        return np.asarray(np.maximum(times(self._press, back), 0.0) / np.sqrt(curvature))

    def _cold_start(self, measured: Array) -> Ids:
        """Loads that press after a projected gradient of pressure alone, one load a marker (Nesterov 1983)."""
        right = times(self._press[self._coarse], measured.reshape(-1).astype(np.float32))
        at = ahead = np.zeros(len(right))
        for k in range(self._limits.descents):
            after = np.maximum(ahead + self._coarse_step * (right - times(self._coarse_gram, ahead)), 0.0)
            ahead = after + k / (k + 3) * (after - at)
            at = after
        seeds = self._coarse[at > self._limits.seed_share * at.max()]
        around = np.union1d(seeds, self._neighbours[seeds].ravel())
        return np.asarray(around[around < len(self._press)])

    def _settle(self, white: Array, whitening: Array, support: Ids) -> tuple[Ids, Array, Array, Array]:
        """The support without loads that would pull, their tractions, covariance, and the whitened residual."""
        found = settled(self._by_load[support], whitening, white.reshape(-1), self._limits.tau**-2)
        return support[found.kept], found.traction, found.inverse, found.residual.reshape(white.shape)


def settled(by_load: NDArray[np.float32], whitening: Array, white: Array, information: float) -> Settled:
    """The tractions that minimise |white - W A t|^2 + information |t|^2, of the loads that press.

    Loads that pull leave together, until all press. Everything runs in the thread of the caller, see ``times``.

    Args:
        by_load: (S, 3, R) the measured numbers by the traction of a load.
        whitening: (M, C, C), with M C = R.
        white: (R,) whitened numbers.
        information: of a traction before the measurement.
    """
    return native.settle(by_load, whitening, white, information)


def times(matrix: NDArray[Any], vector: NDArray[Any]) -> NDArray[Any]:
    """A matrix (R, C) times a vector (C,), or times each row of (N, C), in the thread of the caller.

    The operator @ wakes the threads of linear algebra for a matrix of this size. They wait for their next product by
    computing, for 30 to 100 ms: frame after frame that is a second core.
    """
    return np.asarray(np.einsum("rc,...c->...r", matrix, vector))


def _neighbours(loads_mm: Array, spacing_mm: float) -> Ids:
    """(K, 8) ids of the loads around every load; K stands for none."""
    cell = np.round((loads_mm - loads_mm.min(axis=0)) / spacing_mm).astype(np.intp) + 1
    table = np.full(cell.max(axis=0) + 2, len(loads_mm), np.intp)
    table[cell[:, 0], cell[:, 1]] = np.arange(len(loads_mm))
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    return np.stack([table[cell[:, 0] + i, cell[:, 1] + j] for i, j in steps], axis=1)


def _thinned(loads_mm: Array, spacing_mm: float) -> Ids:
    """Every second load in both directions: about one a marker."""
    cell = np.round(loads_mm / spacing_mm).astype(np.intp)
    return np.flatnonzero((cell % 2 == 0).all(axis=1))


def _connected(support: Ids, neighbours: Ids) -> NDArray[np.intp]:
    """(S,) number of the connected part of every load of the support."""
    place = np.full(int(max(neighbours.max(), len(neighbours))) + 1, -1, np.intp)
    place[support] = np.arange(len(support))
    around = place[neighbours[support]]
    label = np.arange(len(support))
    while True:
        beside = np.where(around >= 0, label[around], len(support)).min(axis=1) if len(support) else label
        lower = np.minimum(label, beside)
        lower = lower[lower]
        if (lower == label).all():
            return np.asarray(np.unique(label, return_inverse=True)[1])
        label = lower
