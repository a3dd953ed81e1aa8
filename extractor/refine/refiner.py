"""Refinement: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles reduce the error from a pixel to some hundredths of a pixel. From there a step by synthesis is a Gauss-Newton
step on the likelihood of the whole image, with the curvature that includes the overlap of the gridlines at the corners.
One such step is nearly enough.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure
from extractor._native import refine as native
from extractor.image.pyramid import Pyramid, PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.presets import SCHEDULES, Preset
from extractor.refine.acceptance import (
    accept_markers,
    update_lost_markers,
)
from extractor.refine.estimate import (
    Appearance,
    EdgeContrasts,
    Estimate,
    RefinedMarkers,
    places_in_view,
)
from extractor.refine.first_look import initial_appearance, update_blur_and_bleed, update_edge_contrasts
from extractor.refine.measure.dot_gain import markers_without_dot_gain
from extractor.refine.measure.gridline_offsets import measure_virtual_markers
from extractor.refine.measure.gridline_weights import short_edge
from extractor.refine.measure.shifted_inks import ShiftedInks
from extractor.refine.outliers import correct_outliers
from extractor.refine.profile_rounds import profile_step
from extractor.refine.recovered_markers import fill_recovered_markers
from extractor.refine.refinement_step import (
    extrapolate_pattern,
    gridlines_of,
    with_pattern_moved,
)
from extractor.refine.relief import Parallax, find_parallax, unknown_parallax
from extractor.refine.solve.fisher_information import Information
from extractor.refine.synthesis_steps import SynthesisSolver

SHARP_SIGMA_PX = 1.15  # blur of an image in focus; at half its scale such an image is looked at first. Chosen
SMALL_BLUR = 0.12  # of an edge; above, one edge is blurred into the next. Chosen
SHORT_RARITY = 30  # one in so many gridlines may be shorter than MIN_EDGE_PX at a reduced scale; chosen
MIN_EDGE_PX = 4.0  # edges at a reduced scale; where blur makes one edge part of the next,
MIN_BLURRED_EDGE_PX = 6.5  # either these
MIN_BLUR_PX = 0.65  # or that blur; chosen, as the two before
RELIEF_POINTS = (
    3  # on each gridline of a layout without virtual markers, to find the parallax of cells; chosen
)


class Refiner:
    """Refines the markers of one layout; its picture is kept from image to image, one for each thread."""

    def __init__(self, topology: Topology, preset: Preset, virtual_per_edge: int) -> None:
        self._topology = topology
        self._virtual = virtual_per_edge
        self._schedule = SCHEDULES[preset]
        stations = virtual_per_edge or (RELIEF_POINTS if topology.cell_height != 0.0 else 0)
        self._synthesis_solver = SynthesisSolver(topology, stations)
        markers, edges = len(topology.spokes), len(topology.edges)
        self._unmeasured: dict[str, Any] = {
            "information": Information(np.zeros((markers, 3)), np.zeros((edges, 4))),
            "roughness": np.zeros(markers),
            "bend_variance": np.zeros(edges),
            "bend": np.zeros((edges, 2)),
            "weight": np.ones(edges),
        }

    def __call__(
        self, pyramid: Pyramid, places: InitialMarkers, before: Appearance | None = None
    ) -> RefinedMarkers:
        """Solve all markers together. A marker farther than ``max_shift`` edges from its place is lost.

        Args:
            pyramid: the image.
            places: the markers' places, to about a pixel.
            before: the appearance of the previous image of a sequence, whose parallax is kept: a contact must not
                move it, as all displacements would change.
        """
        refined = self._refined(pyramid, places, before)
        if before is None or before.parallax is None:
            return refined
        return replace(refined, appearance=refined.appearance._replace(parallax=before.parallax))

    def _refined(self, pyramid: Pyramid, places: InitialMarkers, before: Appearance | None) -> RefinedMarkers:
        """The same with the parallax of this image."""
        usual_edge = short_edge(places.xy_px, self._topology.edges, SHORT_RARITY)
        if before is not None and before.scale == self._reduction_scale(
            before.scale * before.sigma, usual_edge
        ):
            view = pyramid.level(before.scale)
            first = self._first_estimate(view, places, places.xy_px, before)
            refined = self._final_steps(view, *first)
            if refined.appearance.is_similar(before):
                return refined
        view = pyramid.level(min(self._reduction_scale(SHARP_SIGMA_PX, usual_edge), 2))
        estimate, contrasts, places = self._first_estimate(view, places, places.xy_px)
        scale = self._reduction_scale(view.scale * estimate.sigma, usual_edge)
        if scale > view.scale:
            estimate = rescaled(estimate, view, pyramid.level(scale))
            contrasts = rescaled_contrasts(contrasts, view.scale / scale)
        elif scale < view.scale:
            xy = np.where(np.isfinite(places.xy_px), view.to_full_scale(estimate.measured), np.nan)
            estimate, contrasts, places = self._first_estimate(pyramid.level(scale), places, xy)
        return self._final_steps(pyramid.level(scale), estimate, contrasts, places)

    def _reduction_scale(self, sigma_px: float, edge_px: float) -> int:
        """The factor by which an image with this blur and these edges is reduced."""
        scale = min(int(sigma_px / self._schedule.reduction_blur_px), int(edge_px / MIN_EDGE_PX))
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
        """The levels of the inks, the blur, and the round of profiles.

        Args:
            view: the image.
            places: of the full image.
            start: (M, 2) px in the full image, where the profiles are.
            before: the appearance of the previous image of a sequence.

        Returns:
            The estimate, the contrasts across the gridlines, and the places without outliers.
        """
        topology = self._topology
        xy, hidden, maps = extrapolate_pattern(view.to_level(start), topology)
        look = before or initial_appearance(view, topology, xy)
        estimate = Estimate(
            xy=xy,
            measured=xy,
            reliable=xy,
            hidden=hidden,
            maps=maps,
            sigma=look.sigma,
            noise=look.noise,
            levels=look.levels,
            pixel_noise=look.pixel_noise,
            **self._unmeasured,
        )
        lines = gridlines_of(topology, estimate)
        contrasts = update_edge_contrasts(view, topology, estimate, lines)
        if before is None:
            estimate, contrasts = update_blur_and_bleed(view, topology, estimate, lines, contrasts)
        rows = self._schedule.max_profile_rows
        estimate, profile_weight = profile_step(view, topology, estimate, lines, contrasts, rows)
        estimate, places = correct_outliers(view, topology, estimate, profile_weight, places)
        return estimate, contrasts, places

    def _final_steps(
        self,
        view: PyramidLevel,
        estimate: Estimate,
        contrasts: EdgeContrasts,
        places: InitialMarkers,
    ) -> RefinedMarkers:
        """The steps by synthesis.

        Args:
            view: the image.
            estimate, contrasts: after the round of profiles.
            places: of the full image.
        """
        places = places_in_view(view, places)
        if estimate.dot_gain != 0.0:
            xy = markers_without_dot_gain(places.xy_px, self._topology.cells, estimate.dot_gain)
            places = places._replace(xy_px=xy)
        estimate = self._synthesis_solver.steps(view, estimate, self._schedule)
        return self._accept_or_recover(view, estimate, contrasts, places)

    def _accept_or_recover(
        self, view: PyramidLevel, estimate: Estimate, contrasts: EdgeContrasts, places: InitialMarkers
    ) -> RefinedMarkers:
        """The accepted markers; where the drawing does not explain the image, as in glare, the markers by many
        profiles.
        """
        xy, cov, unaccepted, all_accepted = accept_markers(estimate, places, self._topology)
        if inks := shifted_inks(self._topology, estimate):
            xy, cov = inks.markers(xy, cov)
        if all_accepted:
            return self._refined_markers(view, estimate, xy, cov, ~unaccepted, places)
        moved = with_pattern_moved(self._topology, estimate)
        lost = update_lost_markers(xy, cov, unaccepted, moved.xy, places.xy_px, places.edge_px)
        fill_recovered_markers(view, self._topology, moved, contrasts, places, lost, xy, cov)
        return self._refined_markers(view, estimate, xy, cov, ~lost, places)

    def _refined_markers(
        self,
        view: PyramidLevel,
        estimate: Estimate,
        xy: NDArray[np.float64],
        cov: NDArray[np.float64],
        explained: NDArray[np.bool_],
        places: InitialMarkers,
    ) -> RefinedMarkers:
        """The markers at the image's full scale. A lost marker on which all triangles agree lies where these put it."""
        scale, reading = view.scale, estimate.reading
        assert reading is not None
        points = measure_virtual_markers(view, reading)
        if inks := shifted_inks(self._topology, estimate):
            points = inks.points(points, scale)
        xy, cov = native.at_full_scale(xy, cov, places, scale)
        size_px = scale * np.array(view.image.shape[1::-1], dtype=np.float64)
        if self._topology.cell_height != 0.0:
            parallax: Parallax | None = find_parallax(self._topology, xy, points[..., :2], size_px)
        else:
            parallax = unknown_parallax(*estimate.uneven_dot_gain, size_px)
        look = estimate.sigma, estimate.noise, estimate.levels, estimate.pixel_noise
        appearance = Appearance(scale, *look, parallax)
        points = points[:, : self._virtual]
        blur, noise = scale * estimate.sigma, scale * estimate.noise
        return RefinedMarkers(
            xy, cov, explained, blur, noise, appearance, points, estimate.scatter.at_scale(scale)
        )


def shifted_inks(topology: Topology, estimate: Estimate) -> ShiftedInks | None:
    """The shifts of the inks; None where no ink lies off."""
    if not estimate.ink_shift.any():
        return None
    reading = estimate.reading
    assert reading is not None
    return ShiftedInks(topology, estimate.ink_shift, reading.lines, estimate.maps)


def rescaled(estimate: Estimate, old: PyramidLevel, view: PyramidLevel) -> Estimate:
    """An estimate of one view in another view of another scale."""
    ratio = old.scale / view.scale
    # a pixel's own variance is a twelfth of its area
    blur2 = (old.scale * estimate.sigma) ** 2 + (view.scale**2 - old.scale**2) / 12.0
    shift = 0.5 * ratio - 0.5  # of a pixel's middle
    blocks = estimate.information
    return estimate._replace(
        xy=ratio * estimate.xy + shift,
        measured=ratio * estimate.measured + shift,
        reliable=ratio * estimate.reliable + shift,
        maps=ratio * estimate.maps,
        sigma=max(float(np.sqrt(blur2)) / view.scale, measure.MIN_SIGMA_PX),
        dot_gain=ratio * estimate.dot_gain,
        noise=max(ratio * estimate.noise, measure.MIN_NOISE),
        pixel_noise=max(ratio * estimate.pixel_noise, measure.MIN_NOISE),
        levels=estimate.levels._replace(slope=estimate.levels.slope / ratio),
        bend=ratio * estimate.bend,
        scatter=estimate.scatter.at_scale(ratio),
        information=Information(blocks.diagonal / ratio**2, blocks.off_diagonal / ratio**2),
    )


def rescaled_contrasts(contrasts: EdgeContrasts, ratio: float) -> EdgeContrasts:
    """The contrasts in a view in which the gridlines are longer by the factor ``ratio``."""
    clearance = contrasts.clearance.copy()
    clearance[:, 0] *= ratio
    return contrasts._replace(clearance=clearance)
