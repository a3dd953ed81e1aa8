"""Stage 9: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles lead from a pixel to some hundredths of one. From there a step by synthesis is a Gauss-Newton step on the
likelihood of the whole image, with the curvature that the overlap of the gridlines at the corners gives it: one is
nearly all that can be had.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .engine import compiled
from .gridlines import KNOWN, extrapolate, gridlines, local_maps
from .information import Information, assemble, covariances, gradient, solve
from .levels import Frame, Levels, black_at, cell_means, smooth_levels
from .placing import Places
from .profiles import BILINEAR_PX2, profile_blurs, read_profiles, unmixing
from .synthesis import (
    AA,
    AB,
    BB,
    BLUR,
    BLUR_CURVATURE,
    MISFIT,
    PIXELS,
    SHARE_A,
    SHARE_B,
    A,
    B,
    clear,
    draw_cells,
    edge_contrasts,
    read_gridlines,
)
from .topology import Topology

Preset = Literal["fast", "balanced", "accurate"]
PRESETS: tuple[Preset, ...] = ("fast", "balanced", "accurate")

MIN_NOISE = 0.3  # grey levels; rounding alone makes 0.29
USUAL_SIGMA_PX = 1.5  # before it is known
MIN_SIGMA_PX = 0.45  # blur and pixel; the bare pixel has 0.29
MAX_SHIFT = 0.25  # in units of the edges around the marker
PRIOR_PX = 10.0  # how far a marker may be drawn by nothing
PRIOR_BEYOND_PX = 1.0  # the same for those beyond the pattern's known part
BLUR_EDGES = 200  # gridlines that the first estimate of the blur is taken from
MARGIN_SIGMA = 4.0
UNEXPLAINED = (
    25.0  # by which the profiles' covariances are widened where the drawing does not explain the image
)
WEAK = 0.15  # of the usual information, below which a marker does not guide its neighbours' gridlines
MAX_WIDEN = 0.3  # of the blur, in one step
# An error of contrast looks like one of blur: the integral of z g (N - 1/2) over that of (z g)^2 up to BAND, g the
# normal density and N its integral.
CONTRAST_TO_BLUR = 1.79
NO_MODEL = np.empty((0, 0, 3), np.float32)


class Steps(NamedTuple):
    """What a preset does: stations per gridline in each round of profiles, and steps of synthesis at most, until the
    no marker moves by more than ``enough`` of its standard deviations."""

    profiles: tuple[int, ...]
    synthesis: int
    enough: float


STEPS: dict[Preset, Steps] = {
    "fast": Steps((3, 4, 24), 0, 0.0),
    "balanced": Steps((2, 3), 4, 20.0),
    "accurate": Steps((3, 4), 10, 0.7),
}


@dataclass(frozen=True, eq=False)
class Refined:
    """Markers after refinement.

    Attributes:
        xy_px: (M, 2) float64, NaN where nothing was measured.
        cov_px2: (M, 2, 2) float64, NaN where nothing was measured.
        explained: (M,) bool, the drawn pattern explains the image around the marker; where not, its place is from
            profiles alone, and something lies on it.
        blur_px: the blur found in the image, pixel included (sigma).
        noise: the noise found, grey levels, one channel.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    explained: NDArray[np.bool_]
    blur_px: float
    noise: float


class Fit(NamedTuple):
    """The current estimate. ``xy`` is where the pattern is drawn: markers that the image hardly shows, or not at all
    (``beyond``), lie where their neighbours' maps put them; ``measured`` are they as the last step left them;
    ``moved`` is by how many of its standard deviations the last step moved a marker at most."""

    xy: NDArray[np.float64]
    measured: NDArray[np.float64]
    beyond: NDArray[np.bool_]
    maps: NDArray[np.float64]
    sigma: float
    noise: float
    levels: Levels
    information: Information
    moved: float


class Refiner:
    """Refines the markers of one layout; its buffers are kept from image to image, one set a thread."""

    def __init__(self, mesh: Topology, preset: Preset) -> None:
        self._mesh = mesh
        self._steps = STEPS[preset]
        self._kept = threading.local()

    def __call__(self, image: NDArray[np.uint8], places: Places, noise: float) -> Refined:
        """Solve all markers together.

        Args:
            image: (H, W, 3) uint8 BGR.
            places: where the markers were found, to about a pixel.
            noise: standard deviation of a channel, in grey levels; a first estimate.

        A marker that would be moved by more than ``MAX_SHIFT`` of an edge is lost.
        """
        mesh, height, width = self._mesh, image.shape[0], image.shape[1]
        frame = Frame(0.5 * width, 0.5 * height, 0.5 * max(width, height))
        noise = max(noise, MIN_NOISE)
        xy, beyond, maps = self._completed(places.xy_px)
        levels = smooth_levels(
            cell_means(image, NO_MODEL, xy, mesh.cells, USUAL_SIGMA_PX),
            cell_means(image, NO_MODEL, xy, mesh.black, USUAL_SIGMA_PX),
            xy,
            mesh,
            noise,
            frame,
        )
        nothing = Information(np.zeros((len(xy), 3)), np.zeros((len(mesh.edges), 4)))
        fit = Fit(xy, xy, beyond, maps, 0.0, noise, levels, nothing, 0.0)
        for stations in self._steps.profiles:
            fit = self._profile_step(image, fit, frame, stations)
        start = fit
        if self._steps.synthesis:
            fit = fit._replace(sigma=max(np.sqrt(max(fit.sigma**2 - BILINEAR_PX2, 0.0)), MIN_SIGMA_PX))
        for _ in range(self._steps.synthesis):
            fit = self._synthesis_step(image, fit, frame)
            if fit.moved < self._steps.enough:
                break
        return self._result(fit, start, places)

    def _completed(
        self, xy: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """Markers, those just beyond the known ones put where they must be; and the map at each."""
        mesh = self._mesh
        maps = local_maps(xy, mesh.near, mesh.offset, mesh.stencil)
        xy, beyond = extrapolate(xy, maps, mesh.near, mesh.offset)
        return xy, beyond, maps

    def _profile_step(self, image: NDArray[np.uint8], fit: Fit, frame: Frame, stations: int) -> Fit:
        mesh, levels = self._mesh, fit.levels
        lines = gridlines(fit.xy, fit.maps, mesh.edges, mesh.near, mesh.offset)
        contrasts = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        weights, room = unmixing(
            lines, contrasts, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.black, *frame
        )
        sigma = fit.sigma
        if sigma == 0.0:
            blurs = profile_blurs(image, lines, weights, room, max(1, len(lines) // BLUR_EDGES))
            seen = blurs[np.isfinite(blurs)]
            sigma = max(float(np.median(seen)) if len(seen) else 1.0, MIN_SIGMA_PX)
        sums = read_profiles(image, lines, weights, room, sigma, stations)
        use = (sums[:, AA] > 0).astype(np.float64)
        fit = fit._replace(sigma=sigma)
        shift, information = self._solve(sums, sums[:, A], sums[:, B], use, lines, contrasts, False, fit)
        return self._moved(fit, shift, information)

    def _synthesis_step(self, image: NDArray[np.uint8], fit: Fit, frame: Frame) -> Fit:
        mesh, levels, sigma = self._mesh, fit.levels, fit.sigma
        box = _box(fit.xy, MARGIN_SIGMA * sigma + 2, image.shape)
        model = self._buffer(image.shape)
        lines = gridlines(fit.xy, fit.maps, mesh.edges, mesh.near, mesh.offset)
        contrasts = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        clear(model, box)
        draw_cells(
            fit.xy,
            mesh.cells,
            mesh.cell_edges,
            mesh.edges,
            lines,
            levels.cell,
            levels.slope,
            sigma,
            box,
            model,
        )
        bettered = self._level_step(image, model, fit, frame)
        middles = 0.5 * (fit.xy[mesh.edges[:, 0]] + fit.xy[mesh.edges[:, 1]])
        black = black_at(levels.black, middles, *frame)
        sums = read_gridlines(image, model, lines, contrasts, black, sigma, box)
        side = self._side_changes(levels, bettered, middles, frame)
        off = np.einsum("ec,ec->e", contrasts, side)
        to_a, to_b = sums[:, A] - off * sums[:, SHARE_A], sums[:, B] - off * sums[:, SHARE_B]
        use, noise = _trust(sums, to_a, to_b)
        noise = float(noise) if np.isfinite(noise) else fit.noise
        fit = fit._replace(noise=noise, levels=bettered)
        shift, information = self._solve(sums, to_a, to_b, use, lines, contrasts, True, fit)
        sigma = self._blur_step(sums, use, contrasts, lines, fit, sigma)
        return self._moved(fit._replace(sigma=sigma), shift, information)

    def _moved(self, fit: Fit, shift: NDArray[np.float64], information: Information) -> Fit:
        """The fit after a step; the deviations of ``moved`` are those with all other markers known."""
        xx, xy, yy = information.diagonal.T
        x, y = np.where(fit.beyond, 0.0, shift.T)
        moved = float(np.sqrt(np.max(x * x * xx + 2 * x * y * xy + y * y * yy, initial=0.0)))
        measured = fit.xy + shift
        xy_px, beyond, maps = self._completed(np.where(_weak(information)[:, None], np.nan, measured))
        return fit._replace(
            xy=xy_px, measured=measured, beyond=beyond, maps=maps, information=information, moved=moved
        )

    def _level_step(
        self, image: NDArray[np.uint8], model: NDArray[np.float32], fit: Fit, frame: Frame
    ) -> Levels:
        """Levels corrected by what the drawing does not explain in the middle of the cells."""
        mesh, levels = self._mesh, fit.levels
        drawn = cell_means(image, model, fit.xy, mesh.cells, 0.0)
        black = cell_means(image, model, fit.xy, mesh.black, 0.0)
        drawn[:, :3] += levels.cell
        return smooth_levels(drawn, black, fit.xy, mesh, fit.noise, frame)

    def _blur_step(
        self,
        sums: NDArray[np.float64],
        use: NDArray[np.float64],
        contrasts: NDArray[np.float64],
        lines: NDArray[np.float64],
        fit: Fit,
        sigma: float,
    ) -> float:
        """The blur, by how far the gridlines' pixels say that it is another, once the levels are bettered."""
        mesh, levels = self._mesh, fit.levels
        now = edge_contrasts(lines, fit.xy, mesh.cells, mesh.edge_cells, levels.cell, levels.slope)
        strength = np.maximum((contrasts * contrasts).sum(axis=1), 1e-9)
        change = (contrasts * (now - contrasts)).sum(axis=1) / strength
        curvature = use * sums[:, BLUR_CURVATURE]
        total = curvature.sum()
        if total <= 0:
            return sigma
        widen = ((use * sums[:, BLUR]).sum() + CONTRAST_TO_BLUR * sigma * (curvature * change).sum()) / total
        return max(sigma + float(np.clip(widen, -MAX_WIDEN * sigma, MAX_WIDEN * sigma)), MIN_SIGMA_PX)

    def _side_changes(
        self, old: Levels, new: Levels, middles: NDArray[np.float64], frame: Frame
    ) -> NDArray[np.float64]:
        """(E, 3): the change of level of a gridline's two sides together."""
        black = black_at(new.black - old.black, middles, *frame)
        change = np.concatenate([new.cell - old.cell, np.zeros((1, 3))])
        return np.asarray(np.nan_to_num(2 * black + change[self._mesh.edge_cells].sum(axis=1)))

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

    def _result(self, fit: Fit, start: Fit, places: Places) -> Refined:
        """What is sure; where the drawing does not explain the image, as in glare, what the profiles had said."""
        xy, cov = self._sure(fit, places)
        lost = np.isnan(xy[:, 0]) & np.isfinite(places.xy_px[:, 0])
        if lost.any() and start is not fit:
            profiled, wide = self._sure(start, places)
            xy[lost], cov[lost] = profiled[lost], UNEXPLAINED * wide[lost]
        return Refined(xy_px=xy, cov_px2=cov, explained=~lost, blur_px=fit.sigma, noise=fit.noise)

    def _sure(self, fit: Fit, places: Places) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Markers and covariances of a fit, NaN where it is far from the places or not sure."""
        mesh, information = self._mesh, fit.information
        xy = fit.measured.copy()
        cov = covariances(*information, mesh.edges, mesh.spokes, 4 * PRIOR_PX**-2)
        with np.errstate(invalid="ignore"):
            near = np.linalg.norm(xy - places.xy_px, axis=1) < MAX_SHIFT * places.edge_px
            sure = np.einsum("mii->m", cov) < (MAX_SHIFT * places.edge_px) ** 2
        lost = ~(near & sure)
        xy[lost] = np.nan
        cov[lost] = np.nan
        return xy, cov


@compiled
def _trust(sums, to_a, to_b):  # type: ignore[no-untyped-def]
    """(E,) weights, 1 for gridlines whose pixels the pattern explains once they are moved, and the noise."""
    count = sums.shape[0]
    misfit, use = np.full(count, np.nan), np.zeros(count)
    for e in range(count):
        if sums[e, PIXELS] <= 8:
            continue
        aa, ab, bb = sums[e, AA], sums[e, AB], sums[e, BB]
        determinant = max(aa * bb - ab * ab, 1e-9 * (aa + bb) ** 2 + 1e-12)
        explained = (bb * to_a[e] ** 2 - 2 * ab * to_a[e] * to_b[e] + aa * to_b[e] ** 2) / determinant
        misfit[e] = max(sums[e, MISFIT] - explained, 0.0) / (3 * sums[e, PIXELS] - 2)
    usual = max(np.nanmedian(misfit), MIN_NOISE**2)
    for e in range(count):
        if np.isfinite(misfit[e]):
            limit = usual * (1.25 + 5 * np.sqrt(2 / (3 * sums[e, PIXELS] - 2)))
            use[e] = min(1.0, limit / max(misfit[e], 1e-12)) ** 2
    return use, np.sqrt(usual)


def _weak(information: Information) -> NDArray[np.bool_]:
    """(M,) markers that the image says far less about than about most, in one direction at least."""
    xx, xy, yy = information.diagonal.T
    least = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    shown = least > 4 * PRIOR_BEYOND_PX**-2
    return np.asarray(least < WEAK * np.median(least[shown])) if shown.any() else ~shown


def _box(xy: NDArray[np.float64], margin: float, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(4,) x from, y from, x to, y to: the pattern's part of the image."""
    known = xy[np.isfinite(xy[:, 0])]
    low, high = np.floor(known.min(axis=0) - margin), np.ceil(known.max(axis=0) + margin) + 1
    size = np.array([shape[1], shape[0]])
    return np.concatenate([np.clip(low, 0, size), np.clip(high, 0, size)]).astype(np.int64)
