"""What every step of refinement does, by profiles or by synthesis: gridlines between the markers, then the markers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .bending import bend_gridlines, bending_ones, bent, eliminate, freedom, roughness
from .fit import Fit
from .gridlines import KNOWN, extrapolate, gridlines, local_maps
from .information import Information, assemble, gradient, solve
from .stepping import PRIOR_BEYOND_PX, moved, shown, strides, trust
from .topology import Topology

PRIOR_PX = 10.0  # how far a marker may be drawn by nothing


class Judged(NamedTuple):
    """How a gridline is judged by its misfit.

    Attributes:
        values: that each place adds.
        least: places, beyond which it is judged.
        unjudged: trust in one with fewer.
    """

    values: int
    least: int
    unjudged: float


class Heard(NamedTuple):
    """What was read along the gridlines, bending taken out.

    Attributes:
        sums: (E, 24), as ``eliminate`` leaves them. to_a, to_b: (E,) the votes.
        bend: (E, 2) px, by which the gridlines were drawn bent. kept: (E, 6), as ``eliminate`` gives it.
    """

    sums: NDArray[np.float64]
    to_a: NDArray[np.float64]
    to_b: NDArray[np.float64]
    bend: NDArray[np.float64]
    kept: NDArray[np.float64]


def completed(
    mesh: Topology, xy: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Markers, those just beyond the known ones put where they must be; which; and the map at each."""
    maps = local_maps(xy, mesh.near, mesh.offset, mesh.stencil)
    xy, beyond = extrapolate(xy, maps, mesh.near, mesh.offset)
    return xy, beyond, maps


def placed(mesh: Topology, fit: Fit) -> Fit:
    """The fit with its pattern where the last step left the markers."""
    xy, beyond, maps = completed(mesh, fit.guiding)
    return fit._replace(xy=xy, beyond=beyond, maps=maps)


def roughened(mesh: Topology, fit: Fit) -> Fit:
    """The fit with how rough its markers are."""
    about = mesh.edges, mesh.ahead, mesh.third, mesh.spokes, mesh.near
    return fit._replace(rough=roughness(fit.guiding, fit.maps, fit.information.diagonal, *about))


def lines_of(mesh: Topology, fit: Fit) -> NDArray[np.float64]:
    """(E, 8) the fit's gridlines."""
    lines: NDArray[np.float64] = gridlines(fit.xy, fit.maps, mesh.edges, mesh.near, mesh.offset)
    bend_gridlines(lines, fit.bend)
    return lines


def loose_ones(mesh: Topology, fit: Fit) -> NDArray[np.bool_]:
    """(E,) the gridlines that may bend beyond the map, or did."""
    return np.asarray(bending_ones(fit.rough, fit.bend, mesh.edges))


def heard(
    mesh: Topology,
    fit: Fit,
    lines: NDArray[np.float64],
    sums: NDArray[np.float64],
    votes: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    judged: Judged,
) -> tuple[Fit, Heard]:
    """How freely gridlines bend, and what their bending is, taken out of their sums and votes in place."""
    to_a, to_b, off = votes
    stiff, variance = np.zeros(len(sums)), 1.0
    if fit.rough.any() or fit.bend.any():
        # what the drawing misses everywhere is no bending either
        usual = trust(sums, to_a, to_b, np.zeros(len(sums)), *judged)[1]
        variance = max(fit.noise, usual) ** 2 if np.isfinite(usual) else fit.noise**2
        use = np.ones(len(sums)) if fit.reading is None else fit.reading.use
        stiff = freedom(sums, to_a, to_b, off, fit.bend, fit.rough, use, lines, mesh.edges, variance)
    kept = eliminate(sums, to_a, to_b, off, fit.bend, stiff, variance)
    return fit._replace(loose=stiff), Heard(sums, to_a, to_b, fit.bend, kept)


def solved(
    mesh: Topology,
    fit: Fit,
    said: Heard,
    use: NDArray[np.float64],
    lines: NDArray[np.float64],
    contrasts: NDArray[np.float64],
    overlapping: bool,
) -> Fit:
    """The fit with all markers moved together from where they were drawn.

    At their ends gridlines overlap (``overlapping``), unless they were read in their middles only.
    """
    count, variance = len(fit.xy), fit.noise**2
    diagonal, beside = np.empty((count, 3)), np.empty((len(lines), 4))
    believed = use * lines[:, KNOWN]
    prior = np.where(fit.beyond, PRIOR_BEYOND_PX**-2, PRIOR_PX**-2)
    geometry = (lines, contrasts, mesh.edges, mesh.spokes, fit.sigma, variance, prior)
    assemble(said.sums, believed, overlapping, *geometry, diagonal, beside)
    right = gradient(
        believed * said.to_a / variance, believed * said.to_b / variance, lines, mesh.edges, count
    )
    shift = solve(diagonal, beside, mesh.edges, right)
    fit = fit._replace(
        bend=bent(said.bend, said.kept, shift, lines, mesh.edges),
        information=Information(diagonal, beside),
        strides=strides(shift, diagonal, fit.beyond),
    )
    least = shown(said.sums, use, lines, mesh.edges, variance, count)
    measured, guiding = moved(fit.xy, shift, least, use, mesh.spokes)
    return fit._replace(measured=measured, guiding=guiding)
