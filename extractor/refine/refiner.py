"""Stage 9: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles lead from a pixel to some hundredths of one. From there a step by synthesis is a Gauss-Newton step on the
likelihood of the whole image, with the curvature that the overlap of the gridlines at the corners gives it: one is
nearly all that can be had.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import Pyramid, PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import AGREED_DEVIATION, InitialMarkers
from extractor.numeric.compilation import compiled
from extractor.presets import SCHEDULES, Preset
from extractor.refine.acceptance import (
    accepted_markers,
    add_dirt_variance,
    update_lost_markers,
    update_obstructed_markers,
    update_unaccepted_markers,
)
from extractor.refine.estimate import Appearance, EdgeContrasts, Estimate, RefinedMarkers
from extractor.refine.first_look import initial_appearance, update_blur_and_bleed, update_edge_contrasts
from extractor.refine.measure.gridline_bending import mean_at_markers
from extractor.refine.measure.gridline_offsets import measure_virtual_markers
from extractor.refine.measure.gridline_weights import MIN_NOISE, SHORTEST_RARITY, median_edge, short_edges
from extractor.refine.outliers import correct_outliers, find_outliers
from extractor.refine.profile_rounds import profile_step
from extractor.refine.recovered_markers import fill_recovered_markers
from extractor.refine.refinement_step import (
    extrapolate_pattern,
    gridlines_of,
    with_pattern_moved,
    with_roughness,
)
from extractor.refine.solve.fisher_information import Information
from extractor.refine.synthesis.dot_gain import markers_without_dot_gain
from extractor.refine.synthesis_steps import MIN_SIGMA_PX, SMALL_BLUR, WIDE_BLUR, SynthesisSolver

SHARP_SIGMA_PX = 1.15  # of an image in focus at half its scale: the scale for it is looked at first
SHORT_RARITY = 30  # one in so many gridlines may be smaller than that at a reduced scale
MIN_EDGE_PX = 4.0  # edges at a reduced scale, and where blur makes one edge part of the next
MIN_BLURRED_EDGE_PX = 6.5  # either these
MIN_BLUR_PX = 0.65  # or that blur
# A first step may be taken where usual gridlines have so many pixels, and the blur so much of what the preset asks for.
COARSE_EDGE_PX, COARSE_BLUR = 4.5, 0.9
# Where the drawing leaves more than so many times the noise, it explains nothing so well that it may move a marker far.
UNEXPLAINED_NOISE_RATIO = 3.0


class Refiner:
    """Refines the markers of one layout; its picture is kept from image to image, one a thread."""

    def __init__(self, mesh: Topology, preset: Preset, virtual_per_edge: int) -> None:
        self._mesh = mesh
        self._virtual = virtual_per_edge
        self._steps = SCHEDULES[preset]
        self._synthesis_solver = SynthesisSolver(mesh)
        self._every_marker = np.ones(len(mesh.spokes), np.bool_)

    def __call__(
        self, sights: Pyramid, places: InitialMarkers, before: Appearance | None = None
    ) -> RefinedMarkers:
        """Solve all markers together.

        Args:
            sights: the image.
            places: where the markers were found, to about a pixel.
            before: how the image before it looked, in a sequence.

        A marker that would be moved by more than ``sure.MAX_SHIFT`` of an edge is lost.
        """
        edge, usual = short_edges(places.xy_px, self._mesh.edges, SHORTEST_RARITY, SHORT_RARITY)
        if before is not None and before.scale == self._reduction_scale(before.scale * before.sigma, usual):
            view = sights.level(before.scale)
            refined = self._final_steps(view, *self._first_estimate(view, places, places.xy_px, before), edge)
            if refined.seen is not None and refined.seen.near(before):
                return refined
        view = sights.level(min(self._reduction_scale(SHARP_SIGMA_PX, usual), 2))
        fit, sides, places = self._first_estimate(view, places, places.xy_px)
        scale = self._reduction_scale(view.scale * fit.sigma, usual)
        if scale > view.scale:
            fit, sides = (
                rescaled(fit, view, sights.level(scale)),
                rescaled_contrasts(sides, view.scale / scale),
            )
        elif scale < view.scale:
            xy = np.where(np.isfinite(places.xy_px), view.to_full_scale(fit.measured), np.nan)
            fit, sides, places = self._first_estimate(sights.level(scale), places, xy)
        return self._final_steps(sights.level(scale), fit, sides, places, edge, sights)

    def _reduction_scale(self, sigma_px: float, edge_px: float) -> int:
        """By how much to reduce an image with this blur and edges."""
        scale = min(int(sigma_px / self._steps.reduction_blur_px), int(edge_px / MIN_EDGE_PX))
        if sigma_px > SMALL_BLUR * edge_px:
            scale = min(scale, max(int(sigma_px / MIN_BLUR_PX), int(edge_px / MIN_BLURRED_EDGE_PX)))
        return max(1, scale)

    def _first_estimate(
        self,
        view: PyramidLevel,
        places: InitialMarkers,
        start: NDArray[np.float64],
        before: Appearance | None = None,
    ) -> tuple[Estimate, EdgeContrasts, InitialMarkers]:
        """The inks' levels, the blur, and the first round of profiles from ``start`` (M, 2), px in the full image; and
        the places without those that strayed."""
        mesh = self._mesh
        xy, beyond, maps = extrapolate_pattern(mesh, view.to_level(start))
        nothing = Information(np.zeros((len(xy), 3)), np.zeros((len(mesh.edges), 4)))
        smooth, straight = np.zeros(len(xy)), np.zeros((len(mesh.edges), 2))
        stiff = np.zeros(len(mesh.edges))
        seen = before or initial_appearance(view, mesh, xy)
        about = seen.sigma, seen.noise, seen.levels, seen.pixel_noise
        free = smooth, stiff, straight, smooth
        fit = Estimate(xy, xy, xy, beyond, maps, *about, nothing, *free, None)
        lines = gridlines_of(mesh, fit)
        sides = update_edge_contrasts(view, mesh, fit, lines)
        if before is None:
            fit, sides = update_blur_and_bleed(view, mesh, fit, lines, sides)
        fit, trusted = profile_step(
            view, mesh, fit, lines, sides, self._steps.max_profile_rows[0], judged=False
        )
        fit, places = correct_outliers(view, mesh, fit, trusted, places)
        return fit, sides, places

    def _final_steps(
        self,
        view: PyramidLevel,
        fit: Estimate,
        sides: EdgeContrasts,
        places: InitialMarkers,
        edge_px: float,
        sights: Pyramid | None = None,
    ) -> RefinedMarkers:
        """The last round of profiles, and synthesis where the blur asks for it; ``edge_px`` is a short edge. With
        ``sights``, a first step may be taken at twice the scale, where blur and usual gridlines allow that and only
        short ones do not."""
        mesh, steps, places, edge_px = (
            self._mesh,
            self._steps,
            _at_reduced_scale(view, places),
            edge_px / view.scale,
        )
        if fit.dot_gain != 0.0:
            places = replace(places, xy_px=markers_without_dot_gain(places.xy_px, mesh.cells, fit.dot_gain))
        start = with_pattern_moved(mesh, fit)
        if fit.sigma < steps.sharp_blur_share * edge_px and view.scale < steps.cheap_reduction:
            start = with_roughness(mesh, start)
            lines = gridlines_of(mesh, start)
            fit, use = profile_step(view, mesh, start, lines, sides, steps.max_profile_rows[1], judged=True)
            xy, cov = self._accepted_markers(fit, places)
            strays, doubted = find_outliers(mesh, fit, xy, use, places.edge_px)
            xy[strays], cov[strays] = np.nan, np.nan
            update_obstructed_markers(xy, cov, doubted, places.xy_px, places.edge_px, places.whole)
            return self._refined_markers(view, fit, xy, cov, ~doubted, places)
        coarser = start.sigma >= 2 * COARSE_BLUR * steps.reduction_blur_px
        blurred = coarser or start.sigma >= WIDE_BLUR * edge_px
        usual_px, spent = median_edge(start.xy, mesh.edges) if blurred else edge_px, 0.0
        if sights and coarser and usual_px >= 2 * COARSE_EDGE_PX:
            start, spent = self._coarse_step(view, start, sights.level(2 * view.scale))
        fit = self._synthesis_solver.steps(view, start, steps, edge_px, usual_px, spent)
        return self._accept_or_recover(view, fit, sides, places)

    def _coarse_step(self, view: PyramidLevel, fit: Estimate, coarse: PyramidLevel) -> tuple[Estimate, float]:
        """The fit after a first step in a coarser view, and what this cost: the markers start nearer then, for a
        fraction of a step."""
        stepped, spent = self._synthesis_solver.first_step(coarse, rescaled(fit, view, coarse))
        return with_pattern_moved(self._mesh, rescaled(stepped, coarse, view)), spent

    def _accept_or_recover(
        self, view: PyramidLevel, fit: Estimate, sides: EdgeContrasts, places: InitialMarkers
    ) -> RefinedMarkers:
        """What is sure; where the drawing does not explain the image, as in glare, what many profiles say."""
        xy, cov = self._accepted_markers(fit, places)
        strange = fit.noise > UNEXPLAINED_NOISE_RATIO * fit.pixel_noise
        start = places.xy_px, places.edge_px
        unsure, some = update_unaccepted_markers(xy, cov, fit.reliable, *start, strange, fit.dot_gain)
        if not some:
            return self._refined_markers(view, fit, xy, cov, ~unsure, places)
        there = with_pattern_moved(self._mesh, fit, unsure)
        lost = update_lost_markers(xy, cov, unsure, there.xy, *start)
        fill_recovered_markers(view, self._mesh, there, sides, places, lost, xy, cov)
        return self._refined_markers(view, fit, xy, cov, ~lost, places)

    def _refined_markers(
        self,
        view: PyramidLevel,
        fit: Estimate,
        xy: NDArray[np.float64],
        cov: NDArray[np.float64],
        explained: NDArray[np.bool_],
        places: InitialMarkers,
    ) -> RefinedMarkers:
        """The markers at the image's full scale; what was lost though all triangles agree on it is where these say."""
        mesh, scale, reading = self._mesh, view.scale, fit.reading
        assert reading is not None
        picture = self._synthesis_solver.buffers(view.image.shape).synthetic_image
        points = measure_virtual_markers(view.image, picture, reading, self._virtual, scale)
        left = places.xy_px, places.edge_px, places.agreed
        xy, cov, free = _at_full_scale(xy, cov, fit.bend_variance, mesh.spokes, *left, scale)
        blur, noise = scale * fit.sigma, scale * fit.noise
        seen = Appearance(scale, fit.sigma, fit.noise, fit.levels, fit.pixel_noise) if reading.drawn else None
        return RefinedMarkers(xy, cov, explained, free, blur, noise, seen, points)

    def _accepted_markers(
        self, fit: Estimate, places: InitialMarkers
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Markers and covariances of a fit; NaN where it is far from the places or not sure."""
        tables = self._mesh.edges, self._mesh.spokes
        start = places.xy_px, places.edge_px, places.whole
        xy, cov = accepted_markers(
            fit.measured, *fit.information, fit.bend_variance, *tables, *start, self._every_marker
        )
        assert fit.reading is not None
        add_dirt_variance(cov, fit.reading.weight, self._mesh.spokes, places.edge_px)
        if fit.convergence_cov_px2 is not None:
            cov += fit.convergence_cov_px2
        return xy, cov


def rescaled(fit: Estimate, old: PyramidLevel, view: PyramidLevel) -> Estimate:
    """A fit of one view in another one of another scale."""
    ratio = old.scale / view.scale
    # a pixel's own variance is a twelfth of its area
    blur2 = (old.scale * fit.sigma) ** 2 + (view.scale**2 - old.scale**2) / 12.0
    there = 0.5 * ratio - 0.5  # of a pixel's middle
    return fit._replace(
        xy=ratio * fit.xy + there,
        measured=ratio * fit.measured + there,
        reliable=ratio * fit.reliable + there,
        maps=ratio * fit.maps,
        sigma=max(float(np.sqrt(blur2)) / view.scale, MIN_SIGMA_PX),
        dot_gain=ratio * fit.dot_gain,
        noise=max(ratio * fit.noise, MIN_NOISE),
        pixel_noise=max(ratio * fit.pixel_noise, MIN_NOISE),
        levels=fit.levels._replace(slope=fit.levels.slope / ratio),
        bend=ratio * fit.bend,
        information=Information(fit.information.diagonal / ratio**2, fit.information.beside / ratio**2),
    )


def rescaled_contrasts(sides: EdgeContrasts, ratio: float) -> EdgeContrasts:
    """What changes across the gridlines in a view in which these are so many times as long."""
    room = sides.clearance.copy()
    room[:, 0] *= ratio
    return sides._replace(clearance=room)


@compiled
def _at_full_scale(xy, cov, loose, spokes, start, edge, agreed, scale):  # type: ignore[no-untyped-def]
    """Markers and covariances in the full image, and (M,) px how freely gridlines bend at each; what was lost though
    triangles ``agreed`` is where these put it."""
    places, wide, free = np.empty_like(xy), scale**2 * cov, scale * np.sqrt(mean_at_markers(loose, spokes))
    for m in range(xy.shape[0]):
        left = np.isnan(xy[m, 0]) and agreed[m] and np.isfinite(start[m, 0])
        for axis in range(2):
            places[m, axis] = ((start[m, axis] if left else xy[m, axis]) + 0.5) * scale - 0.5
        if left:
            wide[m, 0, 0] = wide[m, 1, 1] = scale**2 * (AGREED_DEVIATION * edge[m]) ** 2
            wide[m, 0, 1] = wide[m, 1, 0] = 0.0
    return places, wide, free


def _at_reduced_scale(view: PyramidLevel, places: InitialMarkers) -> InitialMarkers:
    """Places of the full image in a reduced one."""
    return InitialMarkers(
        view.to_level(places.xy_px), places.edge_px / view.scale, places.cells, places.agreed, places.whole
    )
