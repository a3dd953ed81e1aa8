"""Cells that stand apart (behind a scratch, amid missing ones) are numbered by prediction and color, or left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .numbering import Numbering
from .tables import Lattice

ROUNDS = 12
WITNESSES = 20  # numbered cells through which a quadratic map to the layout is laid
MIN_WITNESSES = 8
SHARP_SHARE = 0.6  # of the cells are triangles: then what is none is a fragment, and its center is no witness
REACH = 4.5  # how far from the nearest of them a cell may stand, in cells
MAX_MISFIT = 0.3  # in cells, between where the map puts a cell and the layout's place for it
MAX_SIGMA = 0.12  # of the map there, in cells
ROBUST_ROUNDS = 4  # what dirt has cut is among the witnesses, too
EXACT = 0.02  # of a cell: witnesses that fit so well are not judged
RIDGE = 1e-3  # holds the curvature of the map where the witnesses lie in a row


def attach(cells: Cells, numbering: Numbering, lattice: Lattice) -> Numbering:
    """Number what is not connected with the reference by any face of the mesh.

    The numbered cells around must map the cell near a place of the layout that holds its ink, with little doubt,
    and nothing else may claim it. Cells of one ink are 1.7 cells apart, so a misfit below 0.3 leaves no choice.
    """
    from scipy.spatial import cKDTree

    if (numbering.cell >= 0).all():
        return numbering
    members = [np.flatnonzero(lattice.ink == ink) for ink in (1, 2, 3)]
    trees = [cKDTree(lattice.center_mm[mine]) for mine in members]
    cell = numbering.cell.copy()
    whole = np.isfinite(cells.corner_px[:, 0, 0])
    if whole.mean() < SHARP_SHARE:
        whole[:] = True
    for _ in range(ROUNDS):
        known, loose = np.flatnonzero((cell >= 0) & whole), np.flatnonzero(cell < 0)
        if len(known) < MIN_WITNESSES or len(loose) == 0:
            break
        predicted, size = _predicted_mm(cells.center_px, cell, lattice, known, loose)
        place = np.full(len(loose), -1, np.int32)
        for ink in (1, 2, 3):
            mine = (cells.ink[loose] == ink) & np.isfinite(predicted[:, 0])
            misfit, nearest = trees[ink - 1].query(predicted[mine])
            place[mine] = np.where(misfit < MAX_MISFIT * size[mine], members[ink - 1][nearest], -1)
        place[_claimed(place, cell)] = -1
        if not (place >= 0).any():
            break
        cell[loose] = place
    return replace(numbering, cell=cell)


def _predicted_mm(
    center_px: NDArray[np.float64],
    cell: NDArray[np.int32],
    lattice: Lattice,
    known: NDArray[np.intp],
    loose: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(L, 2) where each loose cell lies in the layout, NaN where that is doubtful; (L,) a cell's size there, mm."""
    from scipy.spatial import cKDTree

    count = min(WITNESSES, len(known))
    distance, near = cKDTree(center_px[known]).query(center_px[loose], count)
    witness = known[near]
    target = lattice.center_mm[cell[witness]]
    corners = lattice.marker_mm[lattice.corner_ids[cell[witness]]]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=2), axis=3).mean(axis=(1, 2))
    # in units of the spread of the witnesses, with the loose cell at the origin
    scale = distance.mean(axis=1)
    x, y = np.moveaxis((center_px[witness] - center_px[loose, None]) / scale[:, None, None], 2, 0)
    rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    near_weight = 1.0 / (0.3 + (distance / scale[:, None]) ** 2)
    weight, offset = near_weight, target - target.mean(axis=1, keepdims=True)
    for _ in range(ROBUST_ROUNDS):
        normal = np.einsum("lwi,lw,lwj->lij", rows, weight, rows) + RIDGE * np.diag([0, 0, 0, 1, 1, 1])
        sides = np.einsum("lwi,lw,lwk->lik", rows, weight, offset)
        sound = np.linalg.cond(normal) < 1e8
        normal[~sound] = np.eye(6)
        terms = np.linalg.solve(normal, sides)
        squares = ((rows @ terms - offset) ** 2).sum(axis=2)
        usual = 2 * np.median(squares, axis=1) + (EXACT * size) ** 2
        weight = near_weight / (1 + squares / usual[:, None])
    variance = (weight * squares).sum(axis=1) / (2 * weight.sum(axis=1))
    leverage = np.linalg.inv(normal)[:, 0, 0] * weight.mean(axis=1)
    # the image's size of a cell, from the map's slope
    slope = np.abs(np.linalg.det(terms[:, 1:3])) ** 0.5 / scale
    with np.errstate(divide="ignore", invalid="ignore"):
        sound &= distance[:, 0] * slope < REACH * size
        sound &= np.sqrt(variance * (1 + leverage)) < MAX_SIGMA * size
    return np.where(sound[:, None], target.mean(axis=1) + terms[:, 0], np.nan), size


def _claimed(place: NDArray[np.int32], cell: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Places that a numbered cell holds, or that two loose cells claim."""
    claims = np.bincount(np.concatenate([place, cell]) + 1)
    return np.asarray(claims[place + 1] > 1)
