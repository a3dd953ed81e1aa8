"""Stage 9: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles lead from a pixel to some hundredths of one. From there a step by synthesis is a Gauss-Newton step on the
likelihood of the whole image, with the curvature that the overlap of the gridlines at the corners gives it: one is
nearly all that can be had.
"""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bending import HIDDEN, around, bend_gridlines, bent, eliminate, freedom, hidden_misfit, roughness
from .engine import compiled
from .fit import Across, Fit, Refined
from .gridlines import KNOWN, extrapolate, gridlines, local_maps
from .image import estimate_noise
from .information import Information, assemble, covariances, gradient, solve
from .levels import Levels, black_at, cell_means, smooth_levels
from .offsets import Reading, foot_of, measure
from .placing import AGREED, Places
from .presets import STEPS, Preset
from .profiles import profile_blur, read_profiles, unmixing
from .sight import Sight, Sights
from .stepping import (
    MIN_NOISE,
    PRIOR_BEYOND_PX,
    box_of,
    middles,
    moved,
    short_edge,
    shown,
    trust,
    trusted_markers,
    votes,
    widening,
)
from .synthesis import AA, A, B, clear, draw_cells, edge_contrasts, read_gridlines
from .topology import Topology

USUAL_SIGMA_PX = 1.5  # before it is known
MIN_SIGMA_PX = 0.4  # blur and pixel; the bare pixel has 0.29
MIN_EDGE_PX = 6.5  # edges at a reduced scale
MAX_SHIFT = 0.25  # in units of the edges around the marker
MAX_SIGMA = 0.03  # of what is measured, in the same units
PRIOR_PX = 10.0  # how far a marker may be drawn by nothing
BLIND_SIGMA_PX = 0.9  # where no gridline shows it
BLUR_EDGES = 60  # gridlines that the first estimate of the blur is taken from
MARGIN_SIGMA = 4.0
# Where the drawing does not explain the image, dirt moves what is left to see: by how much, and how far triangles and
# profiles may lie apart, in units of the edges around the marker.
UNEXPLAINED = 0.015
MAX_APART = 0.1
MAX_WIDEN = 0.3  # of the blur, in one step
# how a gridline is judged by its misfit: values that each place adds, places needed, and trust in one with fewer
JUDGED_BY_PIXELS = 3, 8, 0.0
JUDGED_BY_SAMPLES = 1, 4, 1.0
JUDGING_STATIONS = 16  # stations per gridline where synthesis has failed
PARDON = 0.1  # of the contrast: what glare and uneven light do to a profile
NO_ROOM = np.empty((0, 4))
NO_MODEL = np.empty((0, 0, 3), np.float32)


class Refiner:
    """Refines the markers of one layout; its buffers are kept from image to image, one set a thread."""

    def __init__(self, mesh: Topology, preset: Preset, virtual_per_edge: int) -> None:
        self._mesh = mesh
        self._virtual = virtual_per_edge
        self._steps = STEPS[preset]
        self._kept = threading.local()

    def __call__(self, sights: Sights, places: Places) -> Refined:
        """Solve all markers together.

        Args:
            sights: the image.
            places: where the markers were found, to about a pixel.

        A marker that would be moved by more than ``MAX_SHIFT`` of an edge is lost.
        """
        edge = short_edge(places.xy_px, self._mesh.edges)
        view = sights.at(min(self._scale(USUAL_SIGMA_PX, edge), 2))
        fit, across = self._begin(view, places)
        scale = self._scale(view.scale * fit.sigma, edge)
        if scale != view.scale:
            xy = np.where(np.isfinite(places.xy_px), view.full(fit.measured), np.nan)
            view = sights.at(scale)
            fit, across = self._begin(view, replace(places, xy_px=xy))
        return self._finish(view, fit, across, _in(view, places), edge / view.scale)

    def _scale(self, sigma_px: float, edge_px: float) -> int:
        """By how much to reduce an image with this blur and edges."""
        return max(1, min(int(sigma_px / self._steps.finest), int(edge_px / MIN_EDGE_PX)))

    def _begin(self, view: Sight, places: Places) -> tuple[Fit, Across]:
        """The inks' levels, the blur, and the first round of profiles."""
        mesh = self._mesh
        xy, beyond, maps = self._completed(view.reduced(places.xy_px))
        noise = max(estimate_noise(view.image, xy, mesh.cells), MIN_NOISE)
        usual = USUAL_SIGMA_PX / view.scale
        levels = smooth_levels(
            cell_means(view.image, NO_MODEL, xy, mesh.cells, usual),
            cell_means(view.image, NO_MODEL, xy, mesh.black, usual),
            xy,
            mesh,
            noise,
            view.frame,
        )
        nothing = Information(np.zeros((len(xy), 3)), np.zeros((len(mesh.edges), 4)))
        smooth, straight = np.zeros(len(xy)), np.zeros((len(mesh.edges), 2))
        stiff = np.zeros(len(mesh.edges))
        fit = Fit(xy, xy, beyond, maps, 0.0, noise, levels, nothing, smooth, stiff, straight, 0.0, None)
        lines = self._lines(fit)
        across = self._across(view, fit, lines)
        fit = fit._replace(sigma=self._blur(view, lines, across))
        fit, _ = self._profile_step(view, fit, across, self._steps.profiles[0], judged=False)
        return fit, across

    def _finish(self, view: Sight, fit: Fit, across: Across, places: Places, edge_px: float) -> Refined:
        """The last round of profiles, and synthesis where the blur asks for it."""
        steps = self._steps
        sharp = fit.sigma < steps.sharp * edge_px and view.scale < steps.reduced
        if sharp:
            fit, trusted = self._profile_step(view, fit, across, steps.profiles[1], judged=True)
            xy, cov = self._sure(fit, places)
            _doubt(xy, cov, ~trusted, places)
            return self._refined(view, fit, xy, cov, trusted, places)
        start = fit
        for step in range(steps.synthesis):
            fit = self._synthesis_step(view, fit, last=step + 1 == steps.synthesis)
            if fit.moved < steps.enough:
                break
        return self._result(view, fit, start, across, places)

    def _completed(
        self, xy: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """Markers, those just beyond the known ones put where they must be; and the map at each."""
        mesh = self._mesh
        maps = local_maps(xy, mesh.near, mesh.offset, mesh.stencil)
        xy, beyond = extrapolate(xy, maps, mesh.near, mesh.offset)
        return xy, beyond, maps

    def _lines(self, fit: Fit) -> NDArray[np.float64]:
        mesh = self._mesh
        lines: NDArray[np.float64] = gridlines(fit.xy, fit.maps, mesh.edges, mesh.near, mesh.offset)
        bend_gridlines(lines, fit.bend)
        return lines

    def _across(self, view: Sight, fit: Fit, lines: NDArray[np.float64]) -> Across:
        """The colors beside the gridlines."""
        mesh, levels = self._mesh, fit.levels
        sides = mesh.cells, mesh.edge_cells, levels.cell
        contrasts = edge_contrasts(lines, fit.xy, *sides, levels.slope)
        return Across(contrasts, *unmixing(lines, contrasts, fit.xy, *sides, levels.black, *view.frame))

    def _profile_step(
        self, view: Sight, fit: Fit, across: Across, stations: int, *, judged: bool
    ) -> tuple[Fit, NDArray[np.bool_]]:
        """The fit after a round of profiles, and (M,) the markers whose gridlines look as they should.

        Gridlines are ``judged`` in the last round only, where they are already close: farther off, the best look wrong.
        """
        mesh = self._mesh
        lines = self._lines(fit)
        sums = read_profiles(
            view.image, lines, across.weights, across.room, fit.sigma, self._loose(fit), stations
        )
        to_a, to_b, off = sums[:, A].copy(), sums[:, B].copy(), np.zeros(len(sums))
        fit, kept = self._eliminated(fit, lines, sums, to_a, to_b, off, JUDGED_BY_SAMPLES)
        use = (sums[:, AA] > 0).astype(np.float64)
        if judged:
            pardon = PARDON**2 * across.room[:, 3]
            use, _ = trust(sums, to_a, to_b, pardon, *JUDGED_BY_SAMPLES)
        shift, information = self._solve(sums, to_a, to_b, use, lines, across.contrasts, False, fit)
        fit = fit._replace(bend=bent(fit.bend, kept, shift, lines, mesh.edges))
        foot, sigma = across.weights[:, 3].copy(), fit.sigma
        reading = Reading(lines, across.contrasts, foot, across.room, use, sigma, fit.noise, False)
        fit = fit._replace(reading=reading)
        fit = self._moved(fit, sums, lines, shift, information, last=judged)
        return fit, trusted_markers(use, mesh.spokes)

    def _blur(self, view: Sight, lines: NDArray[np.float64], across: Across) -> float:
        """The blur that some of the gridlines show, px."""
        every = max(1, len(lines) // BLUR_EDGES)
        sigma = profile_blur(view.image, lines, across.weights, across.room, every)
        return max(sigma, MIN_SIGMA_PX) if np.isfinite(sigma) else BLIND_SIGMA_PX

    def _synthesis_step(self, view: Sight, fit: Fit, *, last: bool) -> Fit:
        image, frame = view.image, view.frame
        mesh, levels, sigma = self._mesh, fit.levels, fit.sigma
        box = box_of(fit.xy, MARGIN_SIGMA * sigma + 2, image.shape[1], image.shape[0])
        lines = self._lines(fit)
        contrasts = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        model = self._drawn(fit, lines, box, image.shape)
        bettered = self._level_step(view, model, fit)
        middle = middles(lines)
        black = black_at(levels.black, middle, *frame)
        sums = read_gridlines(image, model, lines, contrasts, black, sigma, box, self._loose(fit))
        changes = bettered.cell - levels.cell, bettered.black - levels.black
        to_a, to_b, off = votes(sums, contrasts, mesh.edge_cells, *changes, middle, *frame)
        fit, kept = self._eliminated(fit, lines, sums, to_a, to_b, off, JUDGED_BY_PIXELS)
        use, noise = trust(sums, to_a, to_b, hidden_misfit(fit.loose, contrasts, sigma), *JUDGED_BY_PIXELS)
        now = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, bettered.cell, bettered.slope)
        widen = float(
            np.clip(widening(sums, use, contrasts, now, sigma), -MAX_WIDEN * sigma, MAX_WIDEN * sigma)
        )
        fit = fit._replace(noise=float(noise) if np.isfinite(noise) else fit.noise, levels=bettered)
        shift, information = self._solve(sums, to_a, to_b, use, lines, contrasts, True, fit)
        fit = fit._replace(bend=bent(fit.bend, kept, shift, lines, mesh.edges))
        foot = foot_of(contrasts, black, off)
        reading = Reading(lines, contrasts, foot, NO_ROOM, use, sigma, fit.noise, True)
        fit = fit._replace(sigma=max(sigma + widen, MIN_SIGMA_PX), reading=reading)
        return self._moved(fit, sums, lines, shift, information, last=last)

    def _drawn(
        self, fit: Fit, lines: NDArray[np.float64], box: NDArray[np.int64], shape: tuple[int, ...]
    ) -> NDArray[np.float32]:
        """The pattern over black, in a buffer of the image's size."""
        mesh, levels = self._mesh, fit.levels
        model = self._buffer(shape)
        clear(model, box)
        sides = mesh.cells, mesh.cell_edges, mesh.edges, lines
        draw_cells(fit.xy, *sides, levels.cell, levels.slope, fit.sigma, box, model)
        return model

    def _loose(self, fit: Fit) -> NDArray[np.bool_]:
        """(E,) the gridlines that may bend beyond the map, or did."""
        return np.asarray((fit.rough[self._mesh.edges] > 0.0).any(axis=1) | (fit.bend != 0.0).any(axis=1))

    def _eliminated(
        self,
        fit: Fit,
        lines: NDArray[np.float64],
        sums: NDArray[np.float64],
        to_a: NDArray[np.float64],
        to_b: NDArray[np.float64],
        off: NDArray[np.float64],
        judged_by: tuple[int, int, float],
    ) -> tuple[Fit, NDArray[np.float64]]:
        """How freely gridlines bend, and what their bending is, taken out of their sums and votes."""
        if not fit.rough.any() and not fit.bend.any():
            stiff = np.zeros(len(sums))
            return fit._replace(loose=stiff), eliminate(sums, to_a, to_b, off, fit.bend, stiff, 1.0)
        # what the drawing misses everywhere is no bending either
        usual = trust(sums, to_a, to_b, np.zeros(len(sums)), *judged_by)[1]
        variance = max(fit.noise, usual) ** 2 if np.isfinite(usual) else fit.noise**2
        use = np.ones(len(sums)) if fit.reading is None else fit.reading.use
        loose = freedom(sums, to_a, to_b, off, fit.bend, fit.rough, use, lines, self._mesh.edges, variance)
        return fit._replace(loose=loose), eliminate(sums, to_a, to_b, off, fit.bend, loose, variance)

    def _moved(
        self,
        fit: Fit,
        sums: NDArray[np.float64],
        lines: NDArray[np.float64],
        shift: NDArray[np.float64],
        information: Information,
        *,
        last: bool,
    ) -> Fit:
        """The fit after a step; after the ``last`` one nothing is drawn."""
        assert fit.reading is not None
        least = shown(sums, fit.reading.use, lines, self._mesh.edges, fit.noise**2, len(fit.xy))
        measured, guiding, steps = moved(fit.xy, shift, information.diagonal, least, fit.beyond)
        fit = fit._replace(measured=measured, information=information, moved=float(steps))
        if last:
            return fit
        xy, beyond, maps = self._completed(guiding)
        mesh = self._mesh
        rough = roughness(
            guiding, maps, information.diagonal, mesh.edges, mesh.ahead, mesh.third, mesh.spokes, mesh.near
        )
        return fit._replace(xy=xy, beyond=beyond, maps=maps, rough=rough)

    def _level_step(self, view: Sight, model: NDArray[np.float32], fit: Fit) -> Levels:
        """Levels corrected by what the drawing does not explain in the middle of the cells."""
        mesh, levels = self._mesh, fit.levels
        drawn = cell_means(view.image, model, fit.xy, mesh.cells, 0.0)
        black = cell_means(view.image, model, fit.xy, mesh.black, 0.0)
        drawn[:, :3] += levels.cell
        return smooth_levels(drawn, black, fit.xy, mesh, fit.noise, view.frame)

    def _solve(
        self,
        sums: NDArray[np.float64],
        to_a: NDArray[np.float64],
        to_b: NDArray[np.float64],
        use: NDArray[np.float64],
        lines: NDArray[np.float64],
        contrasts: NDArray[np.float64],
        overlapping: bool,
        fit: Fit,
    ) -> tuple[NDArray[np.float64], Information]:
        """The shifts (M, 2) of all markers and the matrix that gave them.

        At their ends gridlines overlap, unless they were read in their middles only.
        """
        mesh, count, variance = self._mesh, len(fit.xy), fit.noise**2
        diagonal, beside = np.empty((count, 3)), np.empty((len(lines), 4))
        use = use * lines[:, KNOWN]
        prior = np.where(fit.beyond, PRIOR_BEYOND_PX**-2, PRIOR_PX**-2)
        geometry = (lines, contrasts, mesh.edges, mesh.spokes, fit.sigma, variance, prior)
        assemble(sums, use, overlapping, *geometry, diagonal, beside)
        right = gradient(use * to_a / variance, use * to_b / variance, lines, mesh.edges, count)
        return solve(diagonal, beside, mesh.edges, right), Information(diagonal, beside)

    def _buffer(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        kept: Any = getattr(self._kept, "residual", None)
        if kept is None or kept.shape != shape:
            kept = self._kept.residual = np.zeros(shape, np.float32)
        return kept  # type: ignore[no-any-return]

    def _result(self, view: Sight, fit: Fit, start: Fit, across: Across, places: Places) -> Refined:
        """What is sure; where the drawing does not explain the image, as in glare, what many profiles say."""
        xy, cov = self._sure(fit, places)
        lost = np.isnan(xy[:, 0]) & np.isfinite(places.xy_px[:, 0])
        if lost.any():
            start, trusted = self._profile_step(view, start, across, JUDGING_STATIONS, judged=True)
            profiled, wide = self._sure(start, places)
            use = lost & trusted
            xy[use], cov[use] = profiled[use], wide[use]
            _doubt(xy, cov, use, places)
        return self._refined(view, fit, xy, cov, ~lost, places)

    def _refined(
        self,
        view: Sight,
        fit: Fit,
        xy: NDArray[np.float64],
        cov: NDArray[np.float64],
        explained: NDArray[np.bool_],
        places: Places,
    ) -> Refined:
        """The markers at the image's full scale; what was lost though all triangles agree on it is where these say."""
        left = np.isnan(xy[:, 0]) & places.agreed & np.isfinite(places.xy_px[:, 0])
        xy[left] = places.xy_px[left]
        cov[left] = ((AGREED * places.edge_px[left]) ** 2)[:, None, None] * np.eye(2)
        scale, reading = view.scale, fit.reading
        assert reading is not None
        points = measure(view.image, self._buffer(view.image.shape), reading, self._virtual, scale)
        free = scale * np.sqrt(around(fit.loose, self._mesh.spokes))
        blur, noise = scale * fit.sigma, scale * fit.noise
        return Refined(view.full(xy), scale**2 * cov, explained, free, blur, noise, points)

    def _sure(self, fit: Fit, places: Places) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Markers and covariances of a fit, NaN where it is far from the places or not sure."""
        mesh, information = self._mesh, fit.information
        xy = fit.measured.copy()
        cov = covariances(*information, mesh.edges, mesh.spokes, 4 * PRIOR_PX**-2)
        cov += HIDDEN**2 * around(fit.loose, mesh.spokes)[:, None, None] * np.eye(2)
        _drop_unsure(xy, cov, places.xy_px, places.edge_px, places.whole)
        return xy, cov


@compiled
def _drop_unsure(xy, cov, start, edge, whole):  # type: ignore[no-untyped-def]
    """Set to NaN what lies far from its ``start`` or is not sure, in place."""
    for m in range(xy.shape[0]):
        dx, dy = xy[m, 0] - start[m, 0], xy[m, 1] - start[m, 1]
        limit = (MAX_APART if whole[m] else MAX_SHIFT) * edge[m]
        spread = cov[m, 0, 0] + cov[m, 1, 1]
        if not (dx * dx + dy * dy < limit * limit and spread < (MAX_SIGMA * edge[m]) ** 2):
            xy[m], cov[m] = np.nan, np.nan


def _doubt(
    xy: NDArray[np.float64], cov: NDArray[np.float64], which: NDArray[np.bool_], places: Places
) -> None:
    """Put markers on which something lies between what profiles and triangles say, in place; NaN where these differ."""
    if not which.any():
        return
    apart = np.linalg.norm(xy - places.xy_px, axis=1)
    with np.errstate(invalid="ignore"):
        lost = which & ~(apart < MAX_APART * places.edge_px)
    xy[which] = 0.5 * (xy[which] + places.xy_px[which])
    doubt = 0.25 * apart**2 + (UNEXPLAINED * places.edge_px) ** 2
    cov[which] += doubt[which, None, None] * np.eye(2)
    xy[lost], cov[lost] = np.nan, np.nan


def _in(view: Sight, places: Places) -> Places:
    """Places of the full image in a reduced one."""
    return replace(places, xy_px=view.reduced(places.xy_px), edge_px=places.edge_px / view.scale)
