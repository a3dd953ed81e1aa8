"""Young's modulus of one sensor from known weights: the forces that were read with an assumed modulus, scaled."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError

Array = NDArray[np.float64]
GRAVITY_M_S2 = 9.80665
FEWEST_WEIGHTS = 3
COLUMNS = ("frame", "mass_g")
MAX_FRAME = 10**9


@dataclass(frozen=True)
class Weights:
    """Frames and the masses in g that stood on the pad in them, (N,) each."""

    frame: NDArray[np.int64]
    mass_g: Array


@dataclass(frozen=True)
class ForceScale:
    """The result of weights.

    Attributes:
        young_mpa, young_sigma_mpa: the modulus under which forces are those of the weights, and its deviation.
        bias_n, bias_sigma_n: force that is read without a weight, and its deviation.
        residual_z: root mean square of the residuals in their stated deviations; 1 is right.
        weights: number of different masses.
    """

    young_mpa: float
    young_sigma_mpa: float
    bias_n: float
    bias_sigma_n: float
    residual_z: float
    weights: int


def parse_weights(text: str, name: str) -> Weights:
    """The weights of a CSV text with the columns ``frame`` and ``mass_g``.

    Raises:
        CmpDesignError: another header, or a row with no number in its range.
    """
    rows = list(csv.reader(io.StringIO(text)))
    if not rows or tuple(cell.strip() for cell in rows[0]) != COLUMNS:
        raise CmpDesignError(f"{name}: the first line is no header {','.join(COLUMNS)}")
    frames, masses = [], []
    for line, row in enumerate(rows[1:], 2):
        if not row:
            continue
        try:
            frame, mass = int(row[0]), float(row[1])
        except (ValueError, IndexError):
            raise CmpDesignError(f"{name}, line {line}: expected a frame's number and a mass in g") from None
        if not (0 <= frame < MAX_FRAME and 0 < mass < float("inf") and len(row) == len(COLUMNS)):
            raise CmpDesignError(f"{name}, line {line}: expected a frame from 0 and a mass above 0 g")
        frames.append(frame)
        masses.append(mass)
    return Weights(np.array(frames, np.int64), np.array(masses, np.float64))


def fit_force_scale(weights: Weights, force_n: Array, variance_n2: Array, young_mpa: float) -> ForceScale:
    """Modulus and bias by weighted least squares: the mass's weight is ``scale`` (force read - bias).

    Frames of one mass share the error of the model, so each mass counts once, by the mean of its frames.

    Args:
        weights: (N,) frames and masses.
        force_n: (N,) normal force that was read in the frames, positive for a press.
        variance_n2: (N,) its variance, with the model's own error.
        young_mpa: the modulus that the forces were read with.

    Raises:
        CmpDesignError: fewer than ``FEWEST_WEIGHTS`` masses with a force, or forces that do not grow with the mass.
    """
    known = np.isfinite(force_n) & (force_n > 0) & np.isfinite(variance_n2)
    masses = np.unique(weights.mass_g[known])
    if len(masses) < FEWEST_WEIGHTS:
        raise CmpDesignError(
            f"{len(masses)} masses have frames with a force; expected {FEWEST_WEIGHTS} or more different ones, so "
            "that modulus and bias are determined"
        )
    of = [known & (weights.mass_g == mass) for mass in masses]
    read = np.array([force_n[mine].mean() for mine in of])
    sigma = np.sqrt([variance_n2[mine].mean() for mine in of])
    design = np.column_stack([masses * GRAVITY_M_S2 / 1000, np.ones(len(masses))])
    normal = (design / sigma[:, None] ** 2).T @ design
    slope, bias = np.linalg.solve(normal, design.T @ (read / sigma**2))
    if slope <= 0:
        raise CmpDesignError(
            "the forces that were read do not grow with the mass; check the frames of the weights"
        )
    cov = np.linalg.inv(normal)
    residual = (read - design @ (slope, bias)) / sigma
    z = float(np.sqrt((residual**2).sum() / (len(masses) - 2)))
    grown = max(1.0, z)
    return ForceScale(
        young_mpa=young_mpa / slope,
        young_sigma_mpa=grown * young_mpa / slope**2 * float(np.sqrt(cov[0, 0])),
        bias_n=float(bias / slope),
        bias_sigma_n=grown * float(np.sqrt(cov[1, 1]) / slope),
        residual_z=z,
        weights=len(masses),
    )
