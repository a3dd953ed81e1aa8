"""Stage 9: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles lead from a pixel to some hundredths of one. From there a step by synthesis is a Gauss-Newton step on the
likelihood of the whole image, with the curvature that the overlap of the gridlines at the corners gives it: one is
nearly all that can be had.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Sight, Sights
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import AGREED, Places
from extractor.numeric.compilation import compiled
from extractor.presets import STEPS, Preset
from extractor.refine.acceptance import dirtied, doubt, lost_ones, sure_ones, unsure_ones
from extractor.refine.estimate import Across, Fit, Refined, Seen
from extractor.refine.first_look import across, cleared, first_look
from extractor.refine.measure.gridline_bending import around
from extractor.refine.measure.gridline_offsets import measure
from extractor.refine.measure.gridline_weights import MIN_NOISE, SHORTEST, short_edges, usual_edge
from extractor.refine.outliers import astray, collected
from extractor.refine.profile_rounds import profiled
from extractor.refine.recovered_markers import regain
from extractor.refine.refinement_step import completed, lines_of, placed, roughened
from extractor.refine.solve.fisher_information import Information
from extractor.refine.synthesis.dot_gain import shrunk
from extractor.refine.synthesis_steps import MIN_SIGMA_PX, SMALL_BLUR, WIDE_BLUR, Draughtsman

SHARP_SIGMA_PX = 1.15  # of an image in focus at half its scale: the scale for it is looked at first
SHORT = 30  # one in so many gridlines may be smaller than that at a reduced scale
MIN_EDGE_PX = 4.0  # edges at a reduced scale, and where blur makes one edge part of the next
MIN_BLURRED_EDGE_PX = 6.5  # either these
MIN_BLUR_PX = 0.65  # or that blur
# A first step may be taken where usual gridlines have so many pixels, and the blur so much of what the preset asks for.
COARSE_EDGE_PX, COARSE_BLUR = 4.5, 0.9
# Where the drawing leaves more than so many times the noise, it explains nothing so well that it may move a marker far.
STRANGE = 3.0


class Refiner:
    """Refines the markers of one layout; its picture is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology, preset: Preset, virtual_per_edge: int) -> None:
        self._mesh = mesh
        self._virtual = virtual_per_edge
        self._steps = STEPS[preset]
        self._draughtsman = Draughtsman(mesh)
        self._all = np.ones(len(mesh.spokes), np.bool_)

    def __call__(self, sights: Sights, places: Places, before: Seen | None = None) -> Refined:
        """Solve all markers together.

        Args:
            sights: the image.
            places: where the markers were found, to about a pixel.
            before: how the image before it looked, in a sequence.

        A marker that would be moved by more than ``sure.MAX_SHIFT`` of an edge is lost.
        """
        edge, usual = short_edges(places.xy_px, self._mesh.edges, SHORTEST, SHORT)
        if before is not None and before.scale == self._scale(before.scale * before.sigma, usual):
            view = sights.at(before.scale)
            refined = self._finish(view, *self._begin(view, places, places.xy_px, before), edge)
            if refined.seen is not None and refined.seen.near(before):
                return refined
        view = sights.at(min(self._scale(SHARP_SIGMA_PX, usual), 2))
        fit, sides, places = self._begin(view, places, places.xy_px)
        scale = self._scale(view.scale * fit.sigma, usual)
        if scale > view.scale:
            fit, sides = rescaled(fit, view, sights.at(scale)), magnified(sides, view.scale / scale)
        elif scale < view.scale:
            xy = np.where(np.isfinite(places.xy_px), view.full(fit.measured), np.nan)
            fit, sides, places = self._begin(sights.at(scale), places, xy)
        return self._finish(sights.at(scale), fit, sides, places, edge, sights)

    def _scale(self, sigma_px: float, edge_px: float) -> int:
        """By how much to reduce an image with this blur and edges."""
        scale = min(int(sigma_px / self._steps.finest), int(edge_px / MIN_EDGE_PX))
        if sigma_px > SMALL_BLUR * edge_px:
            scale = min(scale, max(int(sigma_px / MIN_BLUR_PX), int(edge_px / MIN_BLURRED_EDGE_PX)))
        return max(1, scale)

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
        seen = before or first_look(view, mesh, xy)
        about = seen.sigma, seen.noise, seen.levels, seen.grain
        free = smooth, stiff, straight, smooth
        fit = Fit(xy, xy, xy, beyond, maps, *about, nothing, *free, None)
        lines = lines_of(mesh, fit)
        sides = across(view, mesh, fit, lines)
        if before is None:
            fit, sides = cleared(view, mesh, fit, lines, sides)
        fit, trusted = profiled(view, mesh, fit, lines, sides, self._steps.profiles[0], judged=False)
        fit, places = collected(view, mesh, fit, trusted, places)
        return fit, sides, places

    def _finish(
        self,
        view: Sight,
        fit: Fit,
        sides: Across,
        places: Places,
        edge_px: float,
        sights: Sights | None = None,
    ) -> Refined:
        """The last round of profiles, and synthesis where the blur asks for it; ``edge_px`` is a short edge. With
        ``sights``, a first step may be taken at twice the scale, where blur and usual gridlines allow that and only
        short ones do not."""
        mesh, steps, places, edge_px = self._mesh, self._steps, _in(view, places), edge_px / view.scale
        if fit.swelling != 0.0:
            places = replace(places, xy_px=shrunk(places.xy_px, mesh.cells, fit.swelling))
        start = placed(mesh, fit)
        if fit.sigma < steps.sharp * edge_px and view.scale < steps.reduced:
            start = roughened(mesh, start)
            lines = lines_of(mesh, start)
            fit, use = profiled(view, mesh, start, lines, sides, steps.profiles[1], judged=True)
            xy, cov = self._sure(fit, places)
            strays, doubted = astray(mesh, fit, xy, use, places.edge_px)
            xy[strays], cov[strays] = np.nan, np.nan
            doubt(xy, cov, doubted, places.xy_px, places.edge_px, places.whole)
            return self._refined(view, fit, xy, cov, ~doubted, places)
        coarser = start.sigma >= 2 * COARSE_BLUR * steps.finest
        blurred = coarser or start.sigma >= WIDE_BLUR * edge_px
        usual_px, spent = usual_edge(start.xy, mesh.edges) if blurred else edge_px, 0.0
        if sights and coarser and usual_px >= 2 * COARSE_EDGE_PX:
            start, spent = self._nearer(view, start, sights.at(2 * view.scale))
        fit = self._draughtsman.steps(view, start, steps, edge_px, usual_px, spent)
        return self._result(view, fit, sides, places)

    def _nearer(self, view: Sight, fit: Fit, coarse: Sight) -> tuple[Fit, float]:
        """The fit after a first step in a coarser view, and what this cost: the markers start nearer then, for a
        fraction of a step."""
        stepped, spent = self._draughtsman.approach(coarse, rescaled(fit, view, coarse))
        return placed(self._mesh, rescaled(stepped, coarse, view)), spent

    def _result(self, view: Sight, fit: Fit, sides: Across, places: Places) -> Refined:
        """What is sure; where the drawing does not explain the image, as in glare, what many profiles say."""
        xy, cov = self._sure(fit, places)
        strange = fit.noise > STRANGE * fit.grain
        start = places.xy_px, places.edge_px
        unsure, some = unsure_ones(xy, cov, fit.guiding, *start, strange, fit.swelling)
        if not some:
            return self._refined(view, fit, xy, cov, ~unsure, places)
        there = placed(self._mesh, fit, unsure)
        lost = lost_ones(xy, cov, unsure, there.xy, *start)
        regain(view, self._mesh, there, sides, places, lost, xy, cov)
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
        mesh, scale, reading = self._mesh, view.scale, fit.reading
        assert reading is not None
        picture = self._draughtsman.board(view.image.shape).picture
        points = measure(view.image, picture, reading, self._virtual, scale)
        left = places.xy_px, places.edge_px, places.agreed
        xy, cov, free = _in_full(xy, cov, fit.loose, mesh.spokes, *left, scale)
        blur, noise = scale * fit.sigma, scale * fit.noise
        seen = Seen(scale, fit.sigma, fit.noise, fit.levels, fit.grain) if reading.drawn else None
        return Refined(xy, cov, explained, free, blur, noise, seen, points)

    def _sure(self, fit: Fit, places: Places) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Markers and covariances of a fit; NaN where it is far from the places or not sure."""
        tables = self._mesh.edges, self._mesh.spokes
        start = places.xy_px, places.edge_px, places.whole
        xy, cov = sure_ones(fit.measured, *fit.information, fit.loose, *tables, *start, self._all)
        assert fit.reading is not None
        dirtied(cov, fit.reading.use, self._mesh.spokes, places.edge_px)
        if fit.unsettled is not None:
            cov += fit.unsettled
        return xy, cov


def rescaled(fit: Fit, old: Sight, view: Sight) -> Fit:
    """A fit of one view in another one of another scale."""
    ratio = old.scale / view.scale
    # a pixel's own variance is a twelfth of its area
    blur2 = (old.scale * fit.sigma) ** 2 + (view.scale**2 - old.scale**2) / 12.0
    there = 0.5 * ratio - 0.5  # of a pixel's middle
    return fit._replace(
        xy=ratio * fit.xy + there,
        measured=ratio * fit.measured + there,
        guiding=ratio * fit.guiding + there,
        maps=ratio * fit.maps,
        sigma=max(float(np.sqrt(blur2)) / view.scale, MIN_SIGMA_PX),
        swelling=ratio * fit.swelling,
        noise=max(ratio * fit.noise, MIN_NOISE),
        grain=max(ratio * fit.grain, MIN_NOISE),
        levels=fit.levels._replace(slope=fit.levels.slope / ratio),
        bend=ratio * fit.bend,
        information=Information(fit.information.diagonal / ratio**2, fit.information.beside / ratio**2),
    )


def magnified(sides: Across, ratio: float) -> Across:
    """What changes across the gridlines in a view in which these are so many times as long."""
    room = sides.room.copy()
    room[:, 0] *= ratio
    return sides._replace(room=room)


@compiled
def _in_full(xy, cov, loose, spokes, start, edge, agreed, scale):  # type: ignore[no-untyped-def]
    """Markers and covariances in the full image, and (M,) px how freely gridlines bend at each; what was lost though
    triangles ``agreed`` is where these put it."""
    places, wide, free = np.empty_like(xy), scale**2 * cov, scale * np.sqrt(around(loose, spokes))
    for m in range(xy.shape[0]):
        left = np.isnan(xy[m, 0]) and agreed[m] and np.isfinite(start[m, 0])
        for axis in range(2):
            places[m, axis] = ((start[m, axis] if left else xy[m, axis]) + 0.5) * scale - 0.5
        if left:
            wide[m, 0, 0] = wide[m, 1, 1] = scale**2 * (AGREED * edge[m]) ** 2
            wide[m, 0, 1] = wide[m, 1, 0] = 0.0
    return places, wide, free


def _in(view: Sight, places: Places) -> Places:
    """Places of the full image in a reduced one."""
    return Places(
        view.reduced(places.xy_px), places.edge_px / view.scale, places.cells, places.agreed, places.whole
    )
