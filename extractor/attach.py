"""Cells that stand apart (behind a scratch, amid missing ones) are numbered by prediction and color, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .gradients import gradients
from .numbering import Lattice, Numbering

ROUNDS = 8
WITNESSES = 3  # numbered cells that must predict the same place
REACH = 2.9  # how far off they may stand, in cells
MAX_MISFIT = 0.3  # in cells, between where a witness puts a cell and the layout's place for it


def attach(cells: Cells, numbering: Numbering, lattice: Lattice) -> Numbering:
    """Number what is not connected with the reference by any face of the mesh.

    The nearest numbered cells must agree on one place of the layout, the cell must lie near it and be of its ink,
    and nothing else may claim it. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 leaves no choice.
    """
    from scipy.spatial import cKDTree

    trees = [cKDTree(lattice.center_mm[lattice.ink == ink]) for ink in (1, 2, 3)]
    members = [np.flatnonzero(lattice.ink == ink) for ink in (1, 2, 3)]
    cell = numbering.cell.copy()
    for _ in range(ROUNDS):
        slope = gradients(cells.center_px, cell, lattice)
        known = np.flatnonzero(np.isfinite(slope[:, 0, 0]))
        loose = np.flatnonzero(cell < 0)
        if len(known) < WITNESSES or len(loose) == 0:
            break
        predicted, size = _predicted_mm(cells.center_px, cell, lattice, slope, known, loose)
        place = np.full(len(loose), -1, np.int32)
        for ink in (1, 2, 3):
            mine = (cells.ink[loose] == ink) & np.isfinite(predicted[:, 0, 0])
            misfit, nearest = trees[ink - 1].query(predicted[mine])
            agreed = (nearest == nearest[:, :1]).all(axis=1) & (misfit < MAX_MISFIT * size[mine, None]).all(
                axis=1
            )
            place[mine] = np.where(agreed, members[ink - 1][nearest[:, 0]], -1)
        place[_claimed(place, cell)] = -1
        if not (place >= 0).any():
            break
        cell[loose] = place
    return replace(numbering, cell=cell)


def _predicted_mm(
    center_px: NDArray[np.float64],
    cell: NDArray[np.int32],
    lattice: Lattice,
    slope: NDArray[np.float64],
    known: NDArray[np.intp],
    loose: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(L, W, 2) where each witness puts each loose cell in the layout, NaN out of reach; (L,) a cell's size there."""
    from scipy.spatial import cKDTree

    _, near = cKDTree(center_px[known]).query(center_px[loose], WITNESSES)
    witness = known[near]
    determinant = np.linalg.det(slope[witness])
    sound = (np.abs(determinant) > 1e-12).all(axis=1)
    safe = np.where(sound[:, None, None, None], slope[witness], np.eye(2))
    step = np.linalg.solve(safe, (center_px[loose, None] - center_px[witness])[..., None])[..., 0]
    corners = lattice.marker_mm[lattice.corner_ids[cell[witness]]]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=2), axis=3)
    size = sides.mean(axis=(1, 2))
    sound &= (np.linalg.norm(step, axis=2) < REACH * size[:, None]).all(axis=1)
    predicted = lattice.center_mm[cell[witness]] + step
    return np.where(sound[:, None, None], predicted, np.nan), size


def _claimed(place: NDArray[np.int32], cell: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Places that a numbered cell holds, or that two loose cells claim."""
    claims = np.bincount(np.concatenate([place, cell]) + 1)
    return np.asarray(claims[place + 1] > 1)
