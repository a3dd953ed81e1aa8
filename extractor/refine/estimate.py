"""The values that refinement passes from step to step, and its result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import measure
from extractor.image.pyramid import PyramidLevel
from extractor.numbering.marker_places import InitialMarkers
from extractor.refine.measure.marker_scatter import MarkerScatter
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

    def is_similar(self, other: Appearance) -> bool:
        """Whether blur and levels are nearly the same."""
        blur = abs(self.sigma - other.sigma) < MAX_BLUR_CHANGE * other.sigma
        return blur and bool(level_change(other.levels.cell, self.levels.cell) < MAX_LEVEL_CHANGE)


class GridlineReading(NamedTuple):
    """The gridlines at the last comparison of the image with the pattern. Lengths are px at the scale of the step.

    Attributes:
        lines: (E, 8), as ``gridlines`` gives them.
        contrasts: (E, 3) gray levels, differences of the values on both sides.
        station_sums: (E, m, 2), of the pixels around each virtual marker, the weighted residual and the information.
        weight: (E,) 0 to 1.
        variance_ratio: (E,) of the variance along each gridline to that of noise.
        dot_gain_offset: (E,) px, the shift of the gridline towards (-uy, ux) by dot gain.
        ink_offset: (E,) px, towards (-uy, ux), from the stated gridline to the seen one, where inks lie off.
        ink_variance: (E,) px^2, of the stated gridline, which covers the seen one.
        sigma: px, the blur.
        noise: gray levels.
    """

    lines: NDArray[np.float64]
    contrasts: NDArray[np.float64]
    station_sums: NDArray[np.float64]
    weight: NDArray[np.float64]
    variance_ratio: NDArray[np.float64]
    dot_gain_offset: NDArray[np.float64]
    ink_offset: NDArray[np.float64]
    ink_variance: NDArray[np.float64]
    sigma: float
    noise: float


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
        reading: the last comparison of the image with the pattern.
        scatter: of the markers, each by itself.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    explained: NDArray[np.bool_]
    blur_px: float
    noise: float
    appearance: Appearance
    reading: GridlineReading
    scatter: MarkerScatter

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(E, m, 3) the virtual markers as measured, px, and their variance across the gridline, px^2, NaN where not
        measured.
        """
        return measure.virtual_markers(self.reading, self.appearance.scale)

    def with_parallax(self, parallax: Parallax) -> RefinedMarkers:
        """The same with another parallax of the cells."""
        return replace(self, appearance=self.appearance._replace(parallax=parallax))


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


class FirstEstimate(NamedTuple):
    """The estimate of an image after the round of profiles. Places are px in the image at the scale of the round.

    Attributes:
        measured: (M, 2) all markers.
        reliable: (M, 2) the same, NaN for markers that the image hardly shows.
        bend: (E, 2) px, the bending of the gridlines.
        information: about the markers.
        weight: (E,) 0 to 1, of the gridlines.
        sigma: the blur, px.
        noise, pixel_noise, levels: as in ``Appearance``.
        dot_gain: distance by which the sides of all cells have moved outward, px.
        ink_shift: (3, 2) shifts of the inks in the layout, in units of the mean edge; their mean is 0.
        contrasts: across the gridlines.
        places: the markers' places in the full image, outliers put where their neighbours predict them.
    """

    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    bend: NDArray[np.float64]
    information: Information
    weight: NDArray[np.float64]
    sigma: float
    noise: float
    pixel_noise: float
    dot_gain: float
    ink_shift: NDArray[np.float64]
    levels: InkLevels
    contrasts: EdgeContrasts
    places: InitialMarkers

    def rescaled(self, old: PyramidLevel, view: PyramidLevel) -> FirstEstimate:
        """The estimate of one level of an image in another level."""
        ratio = old.scale / view.scale
        # a pixel's own variance is a twelfth of its area
        blur2 = (old.scale * self.sigma) ** 2 + (view.scale**2 - old.scale**2) / 12.0
        shift = 0.5 * ratio - 0.5  # of a pixel's middle
        blocks, clearance = self.information, self.contrasts.clearance.copy()
        clearance[:, 0] *= ratio
        return self._replace(
            measured=ratio * self.measured + shift,
            reliable=ratio * self.reliable + shift,
            bend=ratio * self.bend,
            information=Information(blocks.diagonal / ratio**2, blocks.off_diagonal / ratio**2),
            sigma=max(float(np.sqrt(blur2)) / view.scale, measure.MIN_SIGMA_PX),
            noise=max(ratio * self.noise, measure.MIN_NOISE),
            pixel_noise=max(ratio * self.pixel_noise, measure.MIN_NOISE),
            dot_gain=ratio * self.dot_gain,
            levels=self.levels._replace(slope=self.levels.slope / ratio),
            contrasts=self.contrasts._replace(clearance=clearance),
        )
