"""Refinement: all markers are solved together, from profiles across the gridlines and then by synthesis.

Profiles reduce the error from a pixel to some hundredths of a pixel. From there a step by synthesis is a Gauss-Newton
step on the likelihood of the whole image, with the curvature that includes the overlap of the gridlines at the corners.
One such step is nearly enough.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extractor._native import refine as native
from extractor.image.pyramid import Pyramid, PyramidLevel
from extractor.layout.topology import Topology
from extractor.numbering.marker_places import InitialMarkers
from extractor.presets import SCHEDULES, Preset
from extractor.refine.estimate import Appearance, FirstEstimate, RefinedMarkers
from extractor.refine.measure.gridline_weights import short_edge
from extractor.refine.relief import find_parallax

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
    """Refines the markers of one layout."""

    def __init__(self, topology: Topology, preset: Preset, virtual_per_edge: int) -> None:
        self._topology = topology
        self._schedule = SCHEDULES[preset]
        # points of each gridline at which drawing and image are compared, too
        self._stations = virtual_per_edge or (RELIEF_POINTS if topology.cell_height != 0.0 else 0)

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
        usual_edge = short_edge(places.xy_px, self._topology.edges, SHORT_RARITY)
        if before is None:
            return self._refined(pyramid, places, usual_edge)
        if before.scale == self._reduction_scale(before.scale * before.sigma, usual_edge):
            view = pyramid.level(before.scale)
            refined = native.refined_again(
                view, self._topology, places, before, self._schedule, self._stations
            )
            if refined.appearance.is_similar(before):
                return refined
        refined = self._refined(pyramid, places, usual_edge)
        return refined if before.parallax is None else refined.with_parallax(before.parallax)

    def _refined(self, pyramid: Pyramid, places: InitialMarkers, usual_edge: float) -> RefinedMarkers:
        """The same for an image whose appearance is not known."""
        view = pyramid.level(min(self._reduction_scale(SHARP_SIGMA_PX, usual_edge), 2))
        first = self.first_estimate(view, places, places.xy_px)
        scale = self._reduction_scale(view.scale * first.sigma, usual_edge)
        if scale > view.scale:
            first = first.rescaled(view, pyramid.level(scale))
        elif scale < view.scale:
            xy = np.where(np.isfinite(first.places.xy_px), view.to_full_scale(first.measured), np.nan)
            first = self.first_estimate(pyramid.level(scale), first.places, xy)
        return self.measured(pyramid.level(scale), first)

    def _reduction_scale(self, sigma_px: float, edge_px: float) -> int:
        """The factor by which an image with this blur and these edges is reduced."""
        scale = min(int(sigma_px / self._schedule.reduction_blur_px), int(edge_px / MIN_EDGE_PX))
        if sigma_px > SMALL_BLUR * edge_px:
            scale = min(scale, max(int(sigma_px / MIN_BLUR_PX), int(edge_px / MIN_BLURRED_EDGE_PX)))
        return max(1, scale)

    def first_estimate(
        self, view: PyramidLevel, places: InitialMarkers, start: NDArray[np.float64]
    ) -> FirstEstimate:
        """The levels of the inks, the blur, and the round of profiles, which are at start (M, 2) px in the full image;
        so are the places.
        """
        return native.first_estimate(
            view, self._topology, start, places, None, self._schedule.max_profile_rows
        )

    def measured(self, view: PyramidLevel, first: FirstEstimate) -> RefinedMarkers:
        """The markers after the steps by synthesis, in the full image. A lost marker on which all triangles agree
        lies where these put it.
        """
        refined = native.refined_markers(view, self._topology, first, self._schedule, self._stations)
        if self._topology.cell_height == 0.0:
            return refined
        size_px = view.scale * np.array(view.image.shape[1::-1], dtype=np.float64)
        points = refined.points[..., :2]
        return refined.with_parallax(find_parallax(self._topology, refined.xy_px, points, size_px))
