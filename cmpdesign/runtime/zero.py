"""The rest frame of a running sensor: the mean of some frames, if the pattern is still and nothing touches it.

Drift of camera and light moves all markers by one affine map, and a contact moves some more than others. What is
left of the way from the former rest frame after the best affine map must therefore be small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.runtime.result import SensorFrame

if TYPE_CHECKING:
    from extractor import Markers, Reference

FRAMES = 8  # that are averaged; chosen
MAX_MOTION = (
    3.0  # RMS of the markers about their means, in stated deviations, of a pattern that is still; chosen
)
MAX_BEND = 4.0  # RMS of the way from the former rest frame beyond an affine map, in stated deviations; chosen
FEWEST_SHARE = 0.5  # of the markers, that must be measured in all frames; chosen


class TouchedError(CmpDesignError):
    """The pattern moves, is touched, or is not seen, so that it has no rest frame now."""


def rest_markers(
    frames: Sequence[SensorFrame], before: Sequence[Markers] | None, layout: Reference, most_px: float | None
) -> tuple[Markers, ...]:
    """The mean markers of each view.

    Args:
        frames: results that follow each other.
        before: the markers at rest so far; None: a pattern that is touched is not refused.
        layout: the pad.
        most_px: largest RMS, beyond an affine map, of the way from the former rest frame; None: by the stated
            deviations.

    Raises:
        TouchedError: the pattern moves, is touched, or is not seen.
    """
    name = frames[0].name
    lost = next((one for one in frames if not one.views or any(not v.markers.found for v in one.views)), None)
    if lost is not None:
        raise TouchedError(f"{name}: no rest frame: the pattern is not seen ({lost.reason})")
    found = []
    for place, views in enumerate(zip(*(one.views for one in frames), strict=True)):
        markers = _mean([view.markers for view in views], name)
        if before is not None:
            _require_untouched(motion_of(markers, before[place].xy_px, layout, most_px), name)
        found.append(markers)
    return tuple(found)


def _mean(several: Sequence[Markers], name: str) -> Markers:
    xy_px = np.stack([one.xy_px for one in several])
    status = np.max([one.status for one in several], axis=0)
    is_measured = (np.stack([one.status for one in several]) == 1).all(axis=0)
    if is_measured.mean() < FEWEST_SHARE:
        raise TouchedError(
            f"{name}: no rest frame: {is_measured.mean():.0%} of the markers are measured in {len(several)} frames; "
            f"{FEWEST_SHARE:.0%} are needed"
        )
    sigma_px = _sigma_px(several[-1].cov_px2[is_measured])
    motion_px = float(np.sqrt(np.var(xy_px[:, is_measured], axis=0, ddof=1).mean()))
    if motion_px > MAX_MOTION * sigma_px:
        raise TouchedError(
            f"{name}: no rest frame: the markers move by {motion_px:.3f} px (RMS), at most "
            f"{MAX_MOTION * sigma_px:.3f} px are still; hold the sensor still and touch nothing"
        )
    cov_px2 = several[-1].cov_px2 / len(several)
    lost = ~np.isfinite(xy_px).all(axis=(0, 2))
    cov_px2[lost], status[lost] = np.nan, 0
    return replace(several[-1], xy_px=xy_px.mean(axis=0), cov_px2=cov_px2, status=status)


class WayFromRest(NamedTuple):
    """The way of the markers of a view from the rest frame, RMS over markers and axes; NaN where it is not known.

    Attributes:
        way_px: all of it.
        drift_px: of the affine map that fits best; NaN while the pattern is touched.
        bend_px: what is left after this map.
        limit_px: the largest ``bend_px`` of a pattern that is not touched.
    """

    way_px: float
    drift_px: float
    bend_px: float
    limit_px: float

    @property
    def is_touched(self) -> bool:
        """False also where it is not known."""
        return self.bend_px > self.limit_px


def motion_of(
    markers: Markers, rest_px: NDArray[Any], layout: Reference, most_px: float | None
) -> WayFromRest:
    """The way from the rest frame.

    Args:
        markers: of a view.
        rest_px: (M, 2) at rest.
        layout: the pad.
        most_px: limit of ``bend_px``; None: by the stated deviations.
    """
    moved_px = markers.xy_px - rest_px
    known = np.isfinite(moved_px).all(axis=1) & (markers.status == 1)
    if known.sum() < max(FEWEST_SHARE * known.size, 4):
        return WayFromRest(float("nan"), float("nan"), float("nan"), float("nan"))
    design = np.column_stack([np.ones(known.sum()), layout.xy_mm[known]])
    drift_px = design @ np.linalg.lstsq(design, moved_px[known], rcond=None)[0]
    way, drift, bend = (
        float(np.sqrt(np.mean(one**2))) for one in (moved_px[known], drift_px, moved_px[known] - drift_px)
    )
    # the former rest frame has the noise of one frame, or less
    by_noise_px = MAX_BEND * _sigma_px(markers.cov_px2[known]) * float(np.sqrt(FRAMES + 1))
    limit = by_noise_px if most_px is None else most_px
    return WayFromRest(way, float("nan") if bend > limit else drift, bend, limit)


def _require_untouched(motion: WayFromRest, name: str) -> None:
    if motion.is_touched:
        raise TouchedError(
            f"{name}: no rest frame: something touches the pattern, which is bent by {motion.bend_px:.3f} px (RMS) "
            f"against the former rest frame, at most {motion.limit_px:.3f} px are at rest; take the contact away, or "
            "give check=False if the former rest frame was wrong"
        )


def _sigma_px(cov_px2: NDArray[Any]) -> float:
    """Root mean square of the deviations per axis."""
    return float(np.sqrt(np.nanmean(np.trace(cov_px2, axis1=1, axis2=2)) / 2))
