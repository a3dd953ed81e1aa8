"""The values that refinement passes from step to step, and its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.image.pyramid import PyramidLevel
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.measure.marker_scatter import NO_SCATTER, MarkerScatter
from extractor.refine.relief import Parallax
from extractor.refine.solve.fisher_information import Information
from extractor.refine.synthesis.ink_levels import InkLevels, level_change

# Changes of blur and levels, relative, above which the appearance of an image differs from the previous image's.
MAX_BLUR_CHANGE, MAX_LEVEL_CHANGE = 0.06, 0.03


class Appearance(NamedTuple):
    """The appearance of an image; the next image of a sequence starts from it.

    Attributes:
        scale: by which the image was reduced.
        sigma: the blur, px at that scale.
        noise: gray levels, one channel, from the residual.
        levels: of the inks.
        pixel_noise: gray levels, one channel, from neighbouring pixels: independent of the pattern's drawing.
        parallax: of cells above or below the black, kept along a sequence; None for flat pads.
    """

    scale: int
    sigma: float
    noise: float
    levels: InkLevels
    pixel_noise: float
    parallax: Parallax | None = None

    def with_lighting(self, before: NDArray[np.float64], now: NDArray[np.float64]) -> Appearance:
        """The appearance in another light.

        Args:
            before, now: (2, C, 3) light of some cells over black, and of their black, in the previous and in the
                present image.
        """
        gain = now[0].sum(axis=0) / np.maximum(before[0].sum(axis=0), 1e-9)
        black = self.levels.black.copy()
        black[:, 0] += (now[1] - before[1]).mean(axis=0)
        cell, slope = self.levels.cell * gain, self.levels.slope * gain[:, None]
        return self._replace(levels=self.levels._replace(cell=cell, slope=slope, black=black))

    def is_similar(self, other: Appearance) -> bool:
        """Whether blur and levels are nearly the same."""
        blur = abs(self.sigma - other.sigma) < MAX_BLUR_CHANGE * other.sigma
        return blur and bool(level_change(other.levels.cell, self.levels.cell) < MAX_LEVEL_CHANGE)


@dataclass(frozen=True, eq=False)
class RefinedMarkers:
    """Markers after refinement.

    Attributes:
        xy_px: (M, 2) float64, NaN where not measured.
        cov_px2: (M, 2, 2) float64, NaN where not measured.
        explained: (M,) bool, the pattern explains the image around the marker. Where not, an object covers the marker
            (and after synthesis, its place is from profiles alone).
        blur_px: the blur found in the image, pixel included (sigma).
        noise: the noise found, gray levels, one channel.
        appearance: appearance of the image.
        points: (E, m, 3) the virtual markers as measured, and their variance across the gridline, NaN where not
            measured.
        scatter: of the markers, each by itself.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    explained: NDArray[np.bool_]
    blur_px: float
    noise: float
    appearance: Appearance
    points: NDArray[np.float64]
    scatter: MarkerScatter


class UnevenDotGain(NamedTuple):
    """Changes of the dot gain over the image beyond what noise explains, px/px, 0 or more.

    Attributes:
        outward: with the distance from the image's middle.
        across: from one side of the image to the other.
    """

    outward: float
    across: float


EVEN = UnevenDotGain(0.0, 0.0)
REGISTERED = np.zeros((3, 2))  # red, green, blue


class Estimate(NamedTuple):
    """The current estimate. Places are px in the image at the scale of the step. Compiled functions take a part of it.

    Attributes:
        xy: (M, 2) places at which the pattern is drawn. Markers that the image hardly shows or does not show
            (``hidden``) lie at the places by the maps of their neighbours.
        measured: (M, 2) all markers after the last step.
        reliable: (M, 2) the same, NaN for markers that the image hardly shows.
        hidden: (M,) bool.
        maps: (M, 2, 5), as ``local_maps`` gives them.
        sigma: the blur, px.
        noise: gray levels, one channel.
        levels: of the inks.
        pixel_noise: as in ``Appearance``.
        information: about the markers.
        roughness: (M,) px^2, roughness of the markers around each marker.
        bend_variance: (E,) px^2, variance of the gridlines' bending beyond the map.
        bend: (E, 2) px, the bending.
        weight: (E,) 0 to 1, of the gridlines in the last step; 1 before the first.
        reading: gridlines and levels that the last step by synthesis compared with the image; None before the first.
        dot_gain: distance by which the sides of all cells have moved outward, px.
        uneven_dot_gain: its changes over the image.
        ink_shift: (3, 2) shifts of the inks in the layout, in units of the mean edge; their mean is 0.
        scatter: of the markers, each by itself.
        convergence_cov_px2: (M, 2, 2) covariance of the remaining error after the last step; None before it.
    """

    xy: NDArray[np.float64]
    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    hidden: NDArray[np.bool_]
    maps: NDArray[np.float64]
    sigma: float
    noise: float
    levels: InkLevels
    pixel_noise: float
    information: Information
    roughness: NDArray[np.float64]
    bend_variance: NDArray[np.float64]
    bend: NDArray[np.float64]
    weight: NDArray[np.float64]
    reading: GridlineReading | None = None
    dot_gain: float = 0.0
    uneven_dot_gain: UnevenDotGain = EVEN
    ink_shift: NDArray[np.float64] = REGISTERED
    scatter: MarkerScatter = NO_SCATTER
    convergence_cov_px2: NDArray[np.float64] | None = None


class EdgeContrasts(NamedTuple):
    """The change of color across the gridlines; the change does not depend on shifts of a gridline by a pixel.

    Attributes:
        sides: (E, 6) light on both sides, as ``GridlineSides`` gives it.
        contrasts: (E, 3) gray levels, differences of the values on both sides.
        clearance: (E, 4), as ``gridline_clearance`` gives it.
    """

    sides: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    clearance: NDArray[np.float64]


def places_in_view(view: PyramidLevel, places: InitialMarkers) -> InitialMarkers:
    """Places of the full image in a reduced image."""
    return places._replace(xy_px=view.to_level(places.xy_px), edge_px=places.edge_px / view.scale)
