"""What refinement passes from step to step, and what it gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.refine.measure.gridline_offsets import GridlineReading
from extractor.refine.solve.fisher_information import Information
from extractor.refine.synthesis.ink_levels import InkLevels, level_change

MAX_BLUR_CHANGE, MAX_LEVEL_CHANGE = (
    0.06,
    0.03,
)  # of the blur and the levels, that no start can take for granted


class Appearance(NamedTuple):
    """How an image looks, for the next one of a sequence to start from: at which scale, the blur (px there), the noise,
    the inks' levels, and the grain: noise as pixels show it that lie side by side, whatever the pattern explains."""

    scale: int
    sigma: float
    noise: float
    levels: InkLevels
    pixel_noise: float

    def with_lighting(self, before: NDArray[np.float64], now: NDArray[np.float64]) -> Appearance:
        """The same in another light.

        Args:
            before, now: (2, C, 3) some cells' inks over black, and their black, in the light then and now.
        """
        gain = now[0].sum(axis=0) / np.maximum(before[0].sum(axis=0), 1e-9)
        black = self.levels.black.copy()
        black[:, 0] += (now[1] - before[1]).mean(axis=0)
        cell, slope = self.levels.cell * gain, self.levels.slope * gain[:, None]
        return self._replace(levels=self.levels._replace(cell=cell, slope=slope, black=black))

    def near(self, other: Appearance) -> bool:
        """Whether blur and levels are nearly the same."""
        blur = abs(self.sigma - other.sigma) < MAX_BLUR_CHANGE * other.sigma
        return blur and bool(level_change(other.levels.cell, self.levels.cell) < MAX_LEVEL_CHANGE)


@dataclass(frozen=True, eq=False)
class RefinedMarkers:
    """Markers after refinement.

    Attributes:
        xy_px: (M, 2) float64, NaN where nothing was measured.
        cov_px2: (M, 2, 2) float64, NaN where nothing was measured.
        explained: (M,) bool, the pattern explains the image around the marker; where not, something lies on it (and
            after synthesis, its place is from profiles alone).
        free_px: (M,) how freely the gridlines at the marker were let bend beyond the smooth map (deviation).
        blur_px: the blur found in the image, pixel included (sigma).
        noise: the noise found, grey levels, one channel.
        seen: how the image looks, where the pattern was drawn.
        points: (E, m, 3) the virtual markers as measured, and their variance across the gridline, NaN where not.
    """

    xy_px: NDArray[np.float64]
    cov_px2: NDArray[np.float64]
    explained: NDArray[np.bool_]
    bend_deviation_px: NDArray[np.float64]
    blur_px: float
    noise: float
    seen: Appearance | None
    points: NDArray[np.float64]


class Estimate(NamedTuple):
    """The current estimate.

    Attributes:
        xy: (M, 2) where the pattern is drawn: markers that the image hardly shows, or not at all (``beyond``), lie
            where their neighbours' maps put them.
        measured: (M, 2), all of them as the last step left them.
        guiding: (M, 2), the same with NaN where the image hardly shows them.
        beyond: (M,) bool.
        maps: (M, 2, 5), as ``local_maps`` gives them.
        sigma: the blur, px. noise: grey levels, one channel. levels: of the inks. grain: as in ``Appearance``.
        information: about the markers.
        rough: (M,) px^2, how rough the markers are around each.
        loose: (E,) px^2, how freely gridlines may bend beyond the map there.
        bend: (E, 2) px, by how much they do.
        strides: (M,) by how many of their standard deviations the last step moved markers from where they were drawn.
        reading: what that step saw.
        usual: by how much gridlines miss what they show, as ``usual_misfit`` gives it; NaN where nothing is drawn.
        swelling: by how much the sides of all cells have moved outward, px.
        unsettled: (M, 2, 2) px^2, what it may have left; None where nothing is drawn.
    """

    xy: NDArray[np.float64]
    measured: NDArray[np.float64]
    reliable: NDArray[np.float64]
    beyond: NDArray[np.bool_]
    maps: NDArray[np.float64]
    sigma: float
    noise: float
    levels: InkLevels
    pixel_noise: float
    information: Information
    roughness: NDArray[np.float64]
    bend_variance: NDArray[np.float64]
    bend: NDArray[np.float64]
    normalized_steps: NDArray[np.float64]
    reading: GridlineReading | None
    median_misfit: float = np.nan
    dot_gain: float = 0.0
    convergence_cov_px2: NDArray[np.float64] | None = None


class EdgeContrasts(NamedTuple):
    """What changes across the gridlines; moves of a pixel do not change it.

    Attributes:
        contrasts: (E, 3) differences of level.
        weights, room: as ``unmixing`` gives them.
    """

    contrasts: NDArray[np.float64]
    weights: NDArray[np.float64]
    clearance: NDArray[np.float64]
