"""The health of a running sensor, from its last frames: what drifts, what is lost, what comes late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmpdesign.runtime.result import SensorFrame
from cmpdesign.sensor.tables import LimitsTable

if TYPE_CHECKING:
    from extractor import Markers, Quality

FRAMES = 256  # over which times are counted; chosen


@dataclass(frozen=True)
class Health:
    """The state of a sensor; NaN where it is not known.

    Attributes:
        frames_per_s: results in a second.
        jitter_ms: standard deviation of the time from one exposure to the next, for frames that follow each other.
        latency_ms: median, 99th percentile and worst, from the middle of the exposure to the result.
        dropped: share of the camera's frames without a result.
        share_read: markers measured, of those of the pattern; of several views the least.
        qualities: of the newest image of each view: blur, noise, contrast, clipping, evenness, scale.
        rest_error_px: RMS over markers and axes of the way from the rest frame; small only where nothing touches.
        events: number of events since the start.
        advice: what to do, one sentence each, with the figure that says so.
    """

    frames_per_s: float
    jitter_ms: float
    latency_ms: tuple[float, float, float]
    dropped: float
    share_read: float
    qualities: tuple[Quality | None, ...]
    rest_error_px: float
    events: int
    advice: tuple[str, ...]


class Timing(NamedTuple):
    """Number, time and latency of a result."""

    number: int
    taken_s: float
    latency_ms: float


def health_of(
    newest: SensorFrame,
    timings: Sequence[Timing],
    rest: Sequence[Markers] | None,
    markers: int,
    limits: LimitsTable,
    events: int,
) -> Health:
    """The health by the last results.

    Args:
        newest: the newest result.
        timings: of the last results, the newest last.
        rest: the markers of each view at rest; None: not known.
        markers: number of markers of the pattern.
        limits: what is accepted.
        events: their number.
    """
    index, taken_s, latency = (np.array(column) for column in zip(*timings, strict=True))
    steps_ms = 1e3 * np.diff(taken_s)[np.diff(index) == 1]
    span_s, count = taken_s[-1] - taken_s[0], index[-1] - index[0]
    measured = [int((view.markers.status == 1).sum()) for view in newest.views]
    share = min(measured, default=0) / max(markers, 1)
    moved = [view.markers.xy_px - one.xy_px for view, one in zip(newest.views, rest or (), strict=False)]
    errors = [float(np.sqrt(np.nanmean(each**2))) for each in moved if np.isfinite(each).any()]
    dropped = 1 - (len(timings) - 1) / count if count else 0.0
    qualities = tuple(view.markers.quality for view in newest.views)
    advice = [hint for quality in qualities if quality is not None for hint in quality.hints]
    if newest.reason:
        advice.append(_reason_text(newest))
    elif share < limits.min_share_read:
        advice.append(
            f"clean the window: {share:.0%} of the markers are measured, {limits.min_share_read:.0%} are expected"
        )
    if dropped > 0.01:
        advice.append(
            f"{dropped:.0%} of the frames have no result; ask for fewer frames a second, or fewer outputs"
        )
    return Health(
        frames_per_s=(len(timings) - 1) / span_s if span_s > 0 else float("nan"),
        jitter_ms=float(np.std(steps_ms)) if len(steps_ms) > 1 else float("nan"),
        latency_ms=(float(np.median(latency)), float(np.percentile(latency, 99)), float(latency.max())),
        dropped=float(dropped),
        share_read=share,
        qualities=qualities,
        rest_error_px=max(errors, default=float("nan")),
        events=events,
        advice=tuple(dict.fromkeys(advice)),
    )


def _reason_text(frame: SensorFrame) -> str:
    texts = [view.markers.reason.text for view in frame.views if view.markers.reason is not None]
    return "; ".join(dict.fromkeys(texts)) or frame.reason
