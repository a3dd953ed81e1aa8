"""What every step of refinement does, by profiles or by synthesis: gridlines between the markers, then the markers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.layout.topology import Topology
from extractor.numeric.compilation import compiled
from extractor.refine.estimate import Estimate
from extractor.refine.measure.gridline_bending import (
    bend_after_shift,
    estimate_bend_variance,
    measure_roughness,
    update_without_bending,
)
from extractor.refine.measure.gridline_weights import (
    PRIOR_HIDDEN_PX,
    least_information,
    markers_after_shift,
    normalized_step_lengths,
    weigh_gridlines,
)
from extractor.refine.solve.fisher_information import Information, fill_information, gradient, solve_shifts
from extractor.refine.synthesis.gridlines import (
    FIRST_RING,
    KNOWN,
    extrapolate_markers,
    gridlines,
    local_maps,
    local_maps_at,
)

PRIOR_PX = 10.0  # how far a marker may be drawn by nothing


class MisfitRule(NamedTuple):
    """How a gridline is judged by its misfit.

    Attributes:
        values: that each place adds.
        least: places, beyond which it is judged.
        unjudged: trust in one with fewer.
    """

    values: int
    min_places: int
    default_weight: float


PIXEL_MISFIT_RULE = MisfitRule(3, 8, 0.0)


def extrapolate_pattern(
    mesh: Topology, xy: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Markers, those just beyond the known ones put where they must be; which; and the map at each."""
    whole: tuple[Any, Any, Any] = _extrapolate_pattern(
        xy, mesh.ring_markers, mesh.ring_vectors, mesh.derivative_stencil
    )
    return whole


@compiled
def _extrapolate_pattern(xy, near, offset, stencil):  # type: ignore[no-untyped-def]
    maps = local_maps(xy, near, offset, stencil)
    xy, beyond = extrapolate_markers(xy, maps, near, offset)
    return xy, beyond, maps


@compiled
def extrapolate_pattern_around(xy, which, maps, near, offset, stencil):  # type: ignore[no-untyped-def]
    """What ``extrapolate_pattern`` gives, with new maps at the markers ``gridlines`` (M,) bool, and beside them."""
    asked = which.copy()
    for m in np.flatnonzero(which):
        for k in range(FIRST_RING):
            if near[m, k] >= 0:
                asked[near[m, k]] = True
    known = np.isfinite(xy[:, 0])
    new, maps = local_maps_at(xy, asked & known, near, offset, stencil), maps.copy()
    for n in range(xy.shape[0]):
        if asked[n] or not known[n]:
            maps[n] = new[n]
    xy, beyond = extrapolate_markers(xy, maps, near, offset)
    return xy, beyond, maps


def with_pattern_moved(mesh: Topology, fit: Estimate, which: NDArray[np.bool_] | None = None) -> Estimate:
    """The fit with its pattern where the last step left the markers; if only gridlines at some are asked for (M,) bool,
    the maps elsewhere stay as they were."""
    if which is None:
        xy, beyond, maps = extrapolate_pattern(mesh, fit.reliable)
    else:
        about = fit.maps, mesh.ring_markers, mesh.ring_vectors, mesh.derivative_stencil
        xy, beyond, maps = extrapolate_pattern_around(fit.reliable, which, *about)
    return fit._replace(xy=xy, beyond=beyond, maps=maps)


def with_roughness(mesh: Topology, fit: Estimate) -> Estimate:
    """The fit with how rough its markers are."""
    about = (
        mesh.edges,
        mesh.next_markers,
        mesh.third_differences,
        mesh.spokes,
        mesh.ring_markers,
        np.ones(len(mesh.spokes), np.bool_),
    )
    return fit._replace(roughness=measure_roughness(fit.reliable, fit.maps, fit.information.diagonal, *about))


def gridlines_of(mesh: Topology, fit: Estimate) -> NDArray[np.float64]:
    """(E, 8) the fit's gridlines."""
    return np.asarray(gridlines(fit.xy, fit.maps, fit.bend, mesh.edges, mesh.edge_vectors))


@compiled
def update_for_bending(sums, to_a, to_b, off, bend, rough, use, lines, edges, noise, values, least, unjudged):  # type: ignore[no-untyped-def]
    """(E,) px^2 how freely gridlines bend, as far as they were in ``weight`` before (E,), and (E, 6) what their bending
    is, taken out of ``sums`` and votes in place."""
    loose, variance = np.zeros(len(sums)), 1.0
    if np.any(rough) or np.any(bend):
        # what the drawing misses everywhere is no bending either
        usual = weigh_gridlines(sums, to_a, to_b, np.zeros(len(sums)), values, least, unjudged)[2]
        variance = max(noise, usual) ** 2 if np.isfinite(usual) else noise**2
        loose = estimate_bend_variance(sums, to_a, to_b, off, bend, rough, use, lines, edges, variance)
    return loose, update_without_bending(sums, to_a, to_b, off, bend, loose, variance)


def with_solution(fit: Estimate, solution: tuple[Any, ...], **others: Any) -> Estimate:
    """The fit with a ``solve_step``, and what else is new."""
    measured, guiding, bend, stepped, diagonal, beside = solution
    about = Information(diagonal, beside)
    return fit._replace(
        measured=measured, reliable=guiding, bend=bend, normalized_steps=stepped, information=about, **others
    )


@compiled
def solve_step(  # type: ignore[no-untyped-def]
    sums, to_a, to_b, bend, kept, use, lines, contrasts, xy, beyond, edges, spokes, sigma, noise, overlapping
):
    """Of ``Estimate``: measured, guiding, bend, strides and the information's blocks, after the step that was asked
    for."""
    count, variance = len(xy), noise**2
    diagonal, beside = np.empty((count, 3)), np.empty((len(lines), 4))
    believed = use * lines[:, KNOWN]
    prior = np.where(beyond, PRIOR_HIDDEN_PX**-2, PRIOR_PX**-2)
    geometry = (lines, contrasts, edges, spokes, sigma, variance, prior)
    fill_information(sums, believed, overlapping, *geometry, diagonal, beside)
    right = gradient(to_a, to_b, believed, variance, lines, edges, count)
    shift = solve_shifts(diagonal, beside, edges, right)
    least = least_information(sums, use, lines, edges, variance, count)
    measured, guiding = markers_after_shift(xy, shift, least, use, spokes)
    bend = bend_after_shift(bend, kept, shift, lines, edges)
    return measured, guiding, bend, normalized_step_lengths(shift, diagonal, beyond), diagonal, beside
