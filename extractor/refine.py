"""Stage 9: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles lead from a pixel to some hundredths of one. From there a step by synthesis is a Gauss-Newton step on the
likelihood of the whole image, with the curvature that the overlap of the gridlines at the corners gives it: one is
nearly all that can be had.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .bending import HIDDEN, around
from .drawing import MIN_SIGMA_PX, SMALL_BLUR, Draughtsman, beside, touching
from .engine import compiled
from .fit import Across, Fit, Refined, Seen
from .image import estimate_noise
from .information import Information, covariances
from .levels import bled, cell_means, smooth_levels, unbled
from .offsets import Reading, measure
from .placing import AGREED, MAX_APART, Places
from .presets import STEPS, Preset
from .profiles import profile_blur, read_profiles, unmixing
from .sight import Sight, Sights
from .step import PRIOR_PX, Heard, Judged, completed, heard, lines_of, loose_ones, placed, roughened, solved
from .stepping import MIN_NOISE, SHORTEST, short_edge, trust, trusted_markers
from .straying import astray, collected, doubted_ones
from .synthesis import AA, A, B, edge_contrasts
from .topology import Topology

USUAL_SIGMA_PX = 1.5  # before it is known
SHORT = 30  # one in so many gridlines may be smaller than that at a reduced scale
MIN_EDGE_PX = 4.0  # edges at a reduced scale, and
MIN_BLURRED_EDGE_PX = 6.5  # where blur makes one edge part of the next
MAX_SHIFT = 0.25  # in units of the edges around the marker
MAX_SIGMA = 0.03  # of what is measured, in the same units
BLIND_SIGMA_PX = 0.9  # where no gridline shows it
BLEEDING = 0.002  # of a neighbour's level in the middle of a cell, from which on it is taken out
BLUR_EDGES = 60  # gridlines that the first estimate of the blur is taken from
# Where the drawing does not explain the image, dirt moves what is left to see, in units of the edges around the marker.
UNEXPLAINED = 0.015
FAR_APART = 0.03  # where all triangles of a marker were found
# Where the drawing leaves more than so many times the noise, it explains nothing so well that a marker may be moved by
STRANGE, MAX_STRANGE = 3.0, 0.13  # of an edge.
JUDGED_BY_SAMPLES = Judged(1, 4, 1.0)
JUDGING_STATIONS = 16  # stations per gridline where synthesis has failed
ELSEWHERE = 5  # one of so many other gridlines shows how well the pattern is explained where nothing is wrong
PARDON = 0.1  # of the contrast: what glare and uneven light do to a profile
NO_MODEL = np.empty((0, 0, 3), np.float32)


class Refiner:
    """Refines the markers of one layout; its picture is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology, preset: Preset, virtual_per_edge: int) -> None:
        self._mesh = mesh
        self._virtual = virtual_per_edge
        self._steps = STEPS[preset]
        self._draughtsman = Draughtsman(mesh)

    def __call__(self, sights: Sights, places: Places, before: Seen | None = None) -> Refined:
        """Solve all markers together.

        Args:
            sights: the image.
            places: where the markers were found, to about a pixel.
            before: how the image before it looked, in a sequence.

        A marker that would be moved by more than ``MAX_SHIFT`` of an edge is lost.
        """
        edge = short_edge(places.xy_px, self._mesh.edges, SHORTEST)
        usual = short_edge(places.xy_px, self._mesh.edges, SHORT)
        if before is not None and before.scale == self._scale(before.scale * before.sigma, usual):
            view = sights.at(before.scale)
            refined = self._finish(view, *self._begin(view, places, places.xy_px, before), edge)
            if refined.seen is not None and refined.seen.near(before):
                return refined
        view = sights.at(max(1, min(int(USUAL_SIGMA_PX / self._steps.finest), int(usual / MIN_EDGE_PX), 2)))
        fit, across, places = self._begin(view, places, places.xy_px)
        scale = self._scale(view.scale * fit.sigma, usual)
        if scale != view.scale:
            xy = np.where(np.isfinite(places.xy_px), view.full(fit.measured), np.nan)
            view = sights.at(scale)
            fit, across, places = self._begin(view, places, xy)
        return self._finish(view, fit, across, places, edge)

    def _scale(self, sigma_px: float, edge_px: float) -> int:
        """By how much to reduce an image with this blur and edges."""
        least = MIN_EDGE_PX if sigma_px < SMALL_BLUR * edge_px else MIN_BLURRED_EDGE_PX
        return max(1, min(int(sigma_px / self._steps.finest), int(edge_px / least)))

    def _begin(
        self, view: Sight, places: Places, start: NDArray[np.float64], before: Seen | None = None
    ) -> tuple[Fit, Across, Places]:
        """The inks' levels, the blur, and the first round of profiles from ``start`` (M, 2), px in the full image; and
        the places without those that strayed."""
        mesh = self._mesh
        xy, beyond, maps = completed(mesh, view.reduced(start))
        nothing = Information(np.zeros((len(xy), 3)), np.zeros((len(mesh.edges), 4)))
        smooth, straight = np.zeros(len(xy)), np.zeros((len(mesh.edges), 2))
        stiff = np.zeros(len(mesh.edges))
        seen = before or self._look(view, xy)
        about = seen.sigma, seen.noise, seen.levels, nothing, smooth, stiff, straight, smooth, None
        fit = Fit(xy, xy, xy, beyond, maps, *about)
        lines = lines_of(mesh, fit)
        across = self._across(view, fit, lines)
        if before is None:
            fit, across = self._cleared(view, fit, lines, across)
        fit, trusted = self._profile_step(view, fit, across, self._steps.profiles[0], judged=False)
        fit, places = collected(view, mesh, fit, trusted, places)
        return fit, across, places

    def _cleared(
        self, view: Sight, fit: Fit, lines: NDArray[np.float64], across: Across
    ) -> tuple[Fit, Across]:
        """The blur, and the levels without what it brings into the middle of a cell from its neighbours."""
        mesh = self._mesh
        fit = fit._replace(sigma=self._blur(view, lines, across))
        share, usual = bled(fit.xy, mesh.cells, fit.sigma, USUAL_SIGMA_PX / view.scale)
        if usual > BLEEDING:
            fit = fit._replace(levels=unbled(fit.levels, mesh.cell_color, share, usual))
            across = self._across(view, fit, lines)
        return fit, across

    def _look(self, view: Sight, xy: NDArray[np.float64]) -> Seen:
        """The noise and the levels in the middles of the cells; the blur is not known yet."""
        mesh = self._mesh
        noise = max(estimate_noise(view.image, xy, mesh.cells), MIN_NOISE)
        usual = USUAL_SIGMA_PX / view.scale
        drawn = cell_means(view.image, NO_MODEL, xy, mesh.cells, usual)
        black = cell_means(view.image, NO_MODEL, xy, mesh.black, usual)
        return Seen(view.scale, 0.0, noise, smooth_levels(drawn, black, xy, mesh, noise, view.frame))

    def _finish(self, view: Sight, fit: Fit, across: Across, places: Places, edge_px: float) -> Refined:
        """The last round of profiles, and synthesis where the blur asks for it; ``edge_px`` is a short edge."""
        steps, places, edge_px = self._steps, _in(view, places), edge_px / view.scale
        start = placed(self._mesh, fit)
        if fit.sigma < steps.sharp * edge_px and view.scale < steps.reduced:
            start = roughened(self._mesh, start)
            fit, use = self._profile_step(view, start, across, steps.profiles[1], judged=True)
            xy, cov = self._sure(fit, places)
            strays, doubted = astray(self._mesh, fit, xy, use, places.edge_px)
            xy[strays], cov[strays] = np.nan, np.nan
            _doubt(xy, cov, doubted, places)
            return self._refined(view, fit, xy, cov, ~doubted, places)
        fit = self._draughtsman.steps(view, start, steps, edge_px)
        return self._result(view, fit, across, places)

    def _across(self, view: Sight, fit: Fit, lines: NDArray[np.float64]) -> Across:
        """The colors beside the gridlines."""
        mesh, levels = self._mesh, fit.levels
        sides = mesh.cells, mesh.edge_cells, levels.cell
        contrasts = edge_contrasts(lines, fit.xy, *sides, levels.slope)
        return Across(contrasts, *unmixing(lines, contrasts, fit.xy, *sides, levels.black, *view.frame))

    def _profile_step(
        self, view: Sight, fit: Fit, across: Across, stations: int, *, judged: bool
    ) -> tuple[Fit, NDArray[np.float64]]:
        """The fit after a round of profiles, and (E,) how far its gridlines look as they should.

        They are ``judged`` by it in the last round, where they are already close; before, the best look wrong, and it
        counts only around markers where little else is seen.
        """
        mesh = self._mesh
        fit, lines, said, trusted = self._profiles(view, fit, across, stations)
        use = trusted
        if not judged:
            read = said.sums[:, AA] > 0.0
            doubted, _ = doubted_ones(trusted, read, mesh.spokes)
            use = np.where(touching(doubted, mesh.edges), trusted, read)
        return self._moved(fit, lines, said, use, across), trusted

    def _profiles(
        self, view: Sight, fit: Fit, across: Across, stations: int
    ) -> tuple[Fit, NDArray[np.float64], Heard, NDArray[np.float64]]:
        """What profiles say: the fit with how freely gridlines bend, these (E, 8), their votes, and (E,) how far they
        look as they should."""
        mesh = self._mesh
        lines, loose = lines_of(mesh, fit), loose_ones(mesh, fit)
        sums = read_profiles(view.image, lines, across.weights, across.room, fit.sigma, loose, stations)
        votes = sums[:, A].copy(), sums[:, B].copy(), np.zeros(len(sums))
        fit, said = heard(mesh, fit, lines, sums, votes, JUDGED_BY_SAMPLES)
        pardon = PARDON**2 * across.room[:, 3]
        trusted, _ = trust(sums, said.to_a, said.to_b, pardon, *JUDGED_BY_SAMPLES)
        return fit, lines, said, trusted

    def _moved(
        self, fit: Fit, lines: NDArray[np.float64], said: Heard, use: NDArray[np.float64], across: Across
    ) -> Fit:
        """The fit with its markers where profiles want them, those in ``use`` (E,)."""
        fit = solved(self._mesh, fit, said, use, lines, across.contrasts, False)
        foot, sigma = across.weights[:, 3].copy(), fit.sigma
        reading = Reading(lines, across.contrasts, foot, across.room, use, sigma, fit.noise, False)
        return fit._replace(reading=reading)

    def _judged(
        self, view: Sight, fit: Fit, across: Across, which: NDArray[np.bool_]
    ) -> tuple[Fit, NDArray[np.bool_]]:
        """A round of profiles around some markers, judged by these and some elsewhere; (M,) which of them are trusted,
        and without any, nothing is moved."""
        edges = self._mesh.edges
        near = which.copy()
        beside(which, edges, near)
        room = across.room.copy()
        elsewhere = ~touching(near, edges)
        elsewhere[::ELSEWHERE] = False
        room[elsewhere] = 0.0
        fit, lines, said, use = self._profiles(view, fit, across._replace(room=room), JUDGING_STATIONS)
        trusted = which & trusted_markers(use, self._mesh.spokes)
        return (self._moved(fit, lines, said, use, across) if trusted.any() else fit), trusted

    def _blur(self, view: Sight, lines: NDArray[np.float64], across: Across) -> float:
        """The blur that some of the gridlines show, px."""
        sigma = profile_blur(view.image, lines, across.weights, across.room, BLUR_EDGES)
        return max(sigma, MIN_SIGMA_PX) if np.isfinite(sigma) else BLIND_SIGMA_PX

    def _result(self, view: Sight, fit: Fit, across: Across, places: Places) -> Refined:
        """What is sure; where the drawing does not explain the image, as in glare, what many profiles say."""
        xy, cov = self._sure(fit, places)
        apart = np.linalg.norm(xy - places.xy_px, axis=1) > MAX_STRANGE * places.edge_px
        if apart.any() and fit.noise > STRANGE * estimate_noise(view.image, fit.xy, self._mesh.cells):
            xy[apart], cov[apart] = np.nan, np.nan
        lost = np.isnan(xy[:, 0]) & np.isfinite(places.xy_px[:, 0])
        if lost.any():
            judged, use = self._judged(view, placed(self._mesh, fit._replace(unsettled=None)), across, lost)
            if use.any():
                profiled, wide = self._sure(judged, places)
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
        points = measure(
            view.image, self._draughtsman.picture(view.image.shape), reading, self._virtual, scale
        )
        free = scale * np.sqrt(around(fit.loose, self._mesh.spokes))
        blur, noise = scale * fit.sigma, scale * fit.noise
        seen = Seen(scale, fit.sigma, fit.noise, fit.levels) if reading.drawn else None
        return Refined(view.full(xy), scale**2 * cov, explained, free, blur, noise, seen, points)

    def _sure(self, fit: Fit, places: Places) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Markers and covariances of a fit, NaN where it is far from the places or not sure."""
        mesh, information = self._mesh, fit.information
        xy = fit.measured.copy()
        cov = covariances(*information, mesh.edges, mesh.spokes, 4 * PRIOR_PX**-2)
        cov += HIDDEN**2 * around(fit.loose, mesh.spokes)[:, None, None] * np.eye(2)
        _drop_unsure(xy, cov, places.xy_px, places.edge_px, places.whole)
        if fit.unsettled is not None:
            cov += fit.unsettled
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
    # all triangles around a marker are seldom wrong together: the farther off, the more they count
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(places.whole, 0.5 / (1.0 + (apart / (FAR_APART * places.edge_px)) ** 2), 0.5)
    xy[which] = (places.xy_px + share[:, None] * (xy - places.xy_px))[which]
    doubt = 0.25 * apart**2 + (UNEXPLAINED * places.edge_px) ** 2
    cov[which] += doubt[which, None, None] * np.eye(2)
    xy[lost], cov[lost] = np.nan, np.nan


def _in(view: Sight, places: Places) -> Places:
    """Places of the full image in a reduced one."""
    return replace(places, xy_px=view.reduced(places.xy_px), edge_px=places.edge_px / view.scale)
