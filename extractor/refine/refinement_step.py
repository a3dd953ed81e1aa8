"""What every step of refinement does, by profiles or by synthesis: gridlines between the markers, then the markers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Fit
from extractor.refine.measure.gridline_bending import bent, eliminate, freedom, roughness
from extractor.refine.measure.gridline_weights import PRIOR_BEYOND_PX, moved, shown, strides, trust
from extractor.refine.solve.fisher_information import Information, assemble, gradient, solve
from extractor.refine.synthesis.gridlines import (
    FIRST_RING,
    KNOWN,
    extrapolate,
    gridlines,
    local_maps,
    maps_at,
)

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


JUDGED_BY_PIXELS = Judged(3, 8, 0.0)


def completed(
    mesh: Topology, xy: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Markers, those just beyond the known ones put where they must be; which; and the map at each."""
    whole: tuple[Any, Any, Any] = _completed(xy, mesh.near, mesh.offset, mesh.stencil)
    return whole


@compiled
def _completed(xy, near, offset, stencil):  # type: ignore[no-untyped-def]
    maps = local_maps(xy, near, offset, stencil)
    xy, beyond = extrapolate(xy, maps, near, offset)
    return xy, beyond, maps


@compiled
def completed_around(xy, which, maps, near, offset, stencil):  # type: ignore[no-untyped-def]
    """What ``completed`` gives, with new maps at the markers ``which`` (M,) bool, and beside them."""
    asked = which.copy()
    for m in np.flatnonzero(which):
        for k in range(FIRST_RING):
            if near[m, k] >= 0:
                asked[near[m, k]] = True
    known = np.isfinite(xy[:, 0])
    new, maps = maps_at(xy, asked & known, near, offset, stencil), maps.copy()
    for n in range(xy.shape[0]):
        if asked[n] or not known[n]:
            maps[n] = new[n]
    xy, beyond = extrapolate(xy, maps, near, offset)
    return xy, beyond, maps


def placed(mesh: Topology, fit: Fit, which: NDArray[np.bool_] | None = None) -> Fit:
    """The fit with its pattern where the last step left the markers; if only gridlines at some are asked for (M,) bool,
    the maps elsewhere stay as they were."""
    if which is None:
        xy, beyond, maps = completed(mesh, fit.guiding)
    else:
        about = fit.maps, mesh.near, mesh.offset, mesh.stencil
        xy, beyond, maps = completed_around(fit.guiding, which, *about)
    return fit._replace(xy=xy, beyond=beyond, maps=maps)


def roughened(mesh: Topology, fit: Fit) -> Fit:
    """The fit with how rough its markers are."""
    about = mesh.edges, mesh.ahead, mesh.third, mesh.spokes, mesh.near, np.ones(len(mesh.spokes), np.bool_)
    return fit._replace(rough=roughness(fit.guiding, fit.maps, fit.information.diagonal, *about))


def lines_of(mesh: Topology, fit: Fit) -> NDArray[np.float64]:
    """(E, 8) the fit's gridlines."""
    return np.asarray(gridlines(fit.xy, fit.maps, fit.bend, mesh.edges, mesh.along))


@compiled
def listened(sums, to_a, to_b, off, bend, rough, use, lines, edges, noise, values, least, unjudged):  # type: ignore[no-untyped-def]
    """(E,) px^2 how freely gridlines bend, as far as they were in ``use`` before (E,), and (E, 6) what their bending
    is, taken out of ``sums`` and votes in place."""
    loose, variance = np.zeros(len(sums)), 1.0
    if np.any(rough) or np.any(bend):
        # what the drawing misses everywhere is no bending either
        usual = trust(sums, to_a, to_b, np.zeros(len(sums)), values, least, unjudged)[2]
        variance = max(noise, usual) ** 2 if np.isfinite(usual) else noise**2
        loose = freedom(sums, to_a, to_b, off, bend, rough, use, lines, edges, variance)
    return loose, eliminate(sums, to_a, to_b, off, bend, loose, variance)


def moved_on(fit: Fit, solution: tuple[Any, ...], **others: Any) -> Fit:
    """The fit with a ``solution``, and what else is new."""
    measured, guiding, bend, stepped, diagonal, beside = solution
    about = Information(diagonal, beside)
    return fit._replace(
        measured=measured, guiding=guiding, bend=bend, strides=stepped, information=about, **others
    )


@compiled
def solution(  # type: ignore[no-untyped-def]
    sums, to_a, to_b, bend, kept, use, lines, contrasts, xy, beyond, edges, spokes, sigma, noise, overlapping
):
    """Of ``Fit``: measured, guiding, bend, strides and the information's blocks, after the step that was asked for."""
    count, variance = len(xy), noise**2
    diagonal, beside = np.empty((count, 3)), np.empty((len(lines), 4))
    believed = use * lines[:, KNOWN]
    prior = np.where(beyond, PRIOR_BEYOND_PX**-2, PRIOR_PX**-2)
    geometry = (lines, contrasts, edges, spokes, sigma, variance, prior)
    assemble(sums, believed, overlapping, *geometry, diagonal, beside)
    right = gradient(to_a, to_b, believed, variance, lines, edges, count)
    shift = solve(diagonal, beside, edges, right)
    least = shown(sums, use, lines, edges, variance, count)
    measured, guiding = moved(xy, shift, least, use, spokes)
    bend = bent(bend, kept, shift, lines, edges)
    return measured, guiding, bend, strides(shift, diagonal, beyond), diagonal, beside
