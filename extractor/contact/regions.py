"""The regions of a pressure field: parts of the touched face that are separated by places with little pressure."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor.contact.gel import Gel

Array = NDArray[np.float64]
AROUND = 3  # cells of that picture's rim around the loads of the support; chosen
FINE = 4  # cells of the picture of the pressure per spacing of the loads; chosen
HERTZ = (
    2.5  # square of a contact's radius over the mean square distance of its pressure from the centre. Derived
)
RESOLVED_SPACINGS = (
    3.0  # radius in spacings of loads from which the shape of the pressure is resolved. Chosen
)
AREA_ERROR = 0.2  # standard deviation of an area, as a share. Measured: python -m benchmarks.force
SADDLE_SHARE = (
    0.6  # of the smaller of two peaks, below which the pressure between them separates regions; chosen
)


@dataclass(frozen=True, eq=False)
class Patch:
    """One region.

    Attributes:
        members: places in the support of its loads.
        area_mm2: touched area.
        outline_mm: (P, 2) its outline: of the places with the highest pressure, on that area.
    """

    members: NDArray[np.intp]
    area_mm2: float
    outline_mm: Array


def touched_area(at_mm: Array, press_n: Array, spacing_mm: float) -> float:
    """The touched area in mm^2, from the moments of forces (S,) at places (S, 2).

    The pressure of a smooth object falls to zero at the rim, that of a flat one rises there. The family
    (1 - r^2 / a^2)^m has both (Hertz: m = 1/2, uniform: 0, flat punch: -1/2, ring: -1): a^2 is m + 2 times the mean
    square of r, and the mean of r^4 gives m. A contact of a few loads is taken as Hertz's.
    """
    centre = press_n @ at_mm / press_n.sum()
    offset = at_mm - centre
    # a single load is as wide as its spacing
    least = np.eye(2) * (spacing_mm**2 / (4 * np.pi * HERTZ))
    spread = (offset * press_n[:, None]).T @ offset / press_n.sum() + least * 2
    squares = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(spread), offset)
    kurtosis = float(press_n @ squares**2 / press_n.sum()) / 4
    factor, ellipse = HERTZ, 2 * np.pi * float(np.sqrt(np.linalg.det(spread)))
    if HERTZ * ellipse > np.pi * (RESOLVED_SPACINGS * spacing_mm) ** 2:
        factor = float(np.clip(kurtosis / max(2 - kurtosis, 1e-9), 1.0, HERTZ))
    return factor * ellipse


def find_patches(gel: Gel, pressure_mpa: Array, support: NDArray[np.intp], press_n: Array) -> list[Patch]:
    """The regions of the pressure (K,) at the loads; every load of the support, of force (S,), belongs to one."""
    step = gel.spacing_mm
    cell = np.round(gel.loads_mm / step).astype(np.intp)
    first = cell[support].min(axis=0) - AROUND
    size = cell[support].max(axis=0) + AROUND + 1 - first
    near = ((cell >= first) & (cell < first + size)).all(axis=1)
    field = np.zeros(size[::-1])
    field[tuple((cell[near] - first).T[::-1])] = pressure_mpa[near]
    labels = _labels(field)
    at = labels[tuple((cell[support] - first).T[::-1])]
    found = []
    fine = cv2.resize(field, None, fx=FINE, fy=FINE, interpolation=cv2.INTER_CUBIC)
    wide = np.repeat(np.repeat(labels, FINE, axis=0), FINE, axis=1)
    for label in np.unique(at):
        members = np.flatnonzero(at == label)
        area = touched_area(gel.loads_mm[support[members]], press_n[members], step)
        own = np.where(wide == label, fine, -np.inf)
        count = int(np.clip(round(area / (step / FINE) ** 2), 1, own.size - 1))
        touched = (own >= np.partition(own.ravel(), -count)[-count]).astype(np.uint8)
        outlines, _ = cv2.findContours(touched, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        outline = max(outlines, key=cv2.contourArea)[:, 0].astype(np.float64)
        outline = ((outline + 0.5) / FINE - 0.5 + first) * step
        found.append(Patch(members, area, _counter_clockwise(outline)))
    return found


def _labels(field: Array) -> NDArray[np.intp]:
    """(ny, nx) label of every cell: cells climb to their neighbourhood's peak; peaks with a high saddle join."""
    ny, nx = field.shape
    padded = np.pad(field, 1, constant_values=-np.inf)
    around = np.stack(
        [padded[1 + i : 1 + i + ny, 1 + j : 1 + j + nx] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    )
    step = around.argmax(axis=0)
    step[field >= around.max(axis=0)] = 4
    rows, columns = np.indices(field.shape)
    goal = ((rows + step // 3 - 1) * nx + columns + step % 3 - 1).ravel()
    for _ in range(int(np.ceil(np.log2(ny + nx))) + 1):
        goal = goal[goal]
    value, grid = field.ravel(), goal.reshape(ny, nx)
    joined = []
    for a, b in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:-1, :-1], np.s_[1:, 1:]),
        (np.s_[1:, :-1], np.s_[:-1, 1:]),
    ):
        one, two, saddle = grid[a], grid[b], np.minimum(field[a], field[b])
        high = (one != two) & (saddle > np.maximum(SADDLE_SHARE * np.minimum(value[one], value[two]), 0))
        joined.append(np.column_stack([one[high], two[high]]))
    for one, two in np.unique(np.concatenate(joined), axis=0):
        goal[goal == goal[one]] = goal[two]
    return np.asarray(goal.reshape(ny, nx))


def _counter_clockwise(outline: Array) -> Array:
    x, y = outline.T
    return outline if (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() >= 0 else outline[::-1].copy()
