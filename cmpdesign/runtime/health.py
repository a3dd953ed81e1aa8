"""The health of a running sensor, from its last frames: what drifts, what is lost, what comes late."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from cmpdesign.runtime.result import SensorFrame
from cmpdesign.runtime.zero import motion_of
from cmpdesign.sensor.tables import LimitsTable

if TYPE_CHECKING:
    from extractor import Markers, Quality, Reference

FRAMES = 4096  # over which times are counted; chosen: 40 of them lie above the 99th percentile
ADVISED_FRAMES, EVERY_FRAMES = 256, 8  # for the advice that becomes events, and how often; chosen, for time
TOLD_AGAIN_S = 60.0  # after which an advice that had gone is an event again; chosen
RECENT = 16  # frames whose median is compared with the rest; chosen
MAX_BLUR_RATIO = 1.5  # blurred by 1.5 times as much, the deviations of markers double; chosen
MIN_LIGHT, MAX_TINT = 0.7, 1.15  # of the light at rest, and of a channel over the mean of all; chosen
MAX_DRIFT_PX = 0.5  # of the pattern at rest; chosen, ten times the deviation of a marker in poor light


@dataclass(frozen=True)
class Health:
    """The state of a sensor; NaN where it is not known.

    Attributes:
        frames_per_s: results in a second.
        jitter_ms: standard deviation of the time from one exposure to the next, for frames that follow each other.
        latency_ms: median, 99th percentile and worst, from the middle of the exposure to the result.
        dropped: share of the camera's frames without a result.
        share_read: markers measured, of those that the rest frame shows; of several views the least.
        left_out: markers that the rest frame does not show, as behind a scratch; they are not expected.
        qualities: of the newest image of each view: blur, noise, contrast, clipping, evenness, scale.
        light: brightness of the picture over that at rest; of several cameras the first's.
        tint: brightness of blue, green and red over that at rest, each over their mean.
        rest_error_px: RMS over markers and axes of the way from the rest frame; small only where nothing touches.
        drift_px: of this way, the RMS of the affine map of camera and warmth; NaN while the pattern is touched.
        events: number of events since the start.
        advice: what to do, one sentence each, with the figure that says so.
    """

    frames_per_s: float
    jitter_ms: float
    latency_ms: tuple[float, float, float]
    dropped: float
    share_read: float
    left_out: int
    qualities: tuple[Quality | None, ...]
    light: float
    tint: tuple[float, float, float]
    rest_error_px: float
    drift_px: float
    events: int
    advice: tuple[str, ...]


class Past(NamedTuple):
    """What is kept of a result.

    Attributes:
        number: of the camera's frame.
        taken_s: middle of the exposure.
        latency_ms: from there to the result.
        light_bgr: (3,) mean of the first camera's image, blue, green, red; NaN without an image.
        measured: of each view, the number of measured markers among those that are expected.
        blur_px: the largest of the views; NaN where it is not known.
    """

    number: int
    taken_s: float
    latency_ms: float
    light_bgr: NDArray[np.float64]
    measured: tuple[int, ...]
    blur_px: float


@dataclass(frozen=True, eq=False)
class AtRest:
    """The sensor at rest.

    Attributes:
        markers: of each view.
        light_bgr: as in ``Past``.
        blur_px: as in ``Past``.
        expected: of each view (M,) bool, the markers that it shows; all, if it shows fewer than are accepted.
    """

    markers: tuple[Markers, ...]
    light_bgr: NDArray[np.float64]
    blur_px: float
    expected: tuple[NDArray[np.bool_], ...]

    @classmethod
    def of(
        cls, markers: Sequence[Markers], past: Sequence[Past], layout: Reference, limits: LimitsTable
    ) -> Self:
        """The rest of some frames.

        Args:
            markers: of each view, their mean.
            past: of these frames.
            layout: the pad.
            limits: what is accepted.
        """
        seen = [layout.present & (one.status == 1) for one in markers]
        most = layout.present.sum() * limits.min_share_read
        expected = tuple(one if one.sum() >= most else layout.present for one in seen)
        light_bgr, blur_px = _medians(past)
        return cls(tuple(markers), light_bgr, blur_px, expected)


def past_of(frame: SensorFrame, image: NDArray[Any] | None, rest: AtRest | None) -> Past:
    """What is kept of a result; ``image``: of the first camera."""
    light_bgr = np.full(3, np.nan)
    if image is not None and image.ndim == 3:
        light_bgr = image[::8, ::8, :3].reshape(-1, 3).mean(axis=0)
    status = [view.markers.status == 1 for view in frame.views]
    measured = [one if rest is None else one & mask for one, mask in _pairs(status, rest)]
    blurs = [view.markers.quality.blur_px for view in frame.views if view.markers.quality is not None]
    return Past(
        frame.index,
        frame.taken_s,
        frame.latency_ms,
        light_bgr,
        tuple(int(one.sum()) for one in measured),
        max(blurs, default=float("nan")),
    )


def _pairs(
    status: Sequence[NDArray[np.bool_]], rest: AtRest | None
) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    return zip(status, status if rest is None else rest.expected, strict=False)


def _medians(past: Sequence[Past]) -> tuple[NDArray[np.float64], float]:
    """Light and blur of some frames, NaN where none has them."""
    lights, blurs = np.array([one.light_bgr for one in past]), np.array([one.blur_px for one in past])
    lights, blurs = lights[np.isfinite(lights).all(axis=1)], blurs[np.isfinite(blurs)]
    light_bgr = np.median(lights, axis=0) if len(lights) else np.full(3, np.nan)
    return light_bgr, float(np.median(blurs)) if len(blurs) else float("nan")


def health_of(
    newest: SensorFrame,
    past: Sequence[Past],
    rest: AtRest | None,
    layout: Reference,
    limits: LimitsTable,
    events: int,
) -> Health:
    """The health by the last results.

    Args:
        newest: the newest result.
        past: the last results, the newest last.
        rest: the sensor at rest; None: not known.
        layout: the pad.
        limits: what is accepted.
        events: their number.
    """
    index, taken_s, latency = (np.array(column) for column in zip(*((one[:3]) for one in past), strict=True))
    steps_ms = 1e3 * np.diff(taken_s)[np.diff(index) == 1]
    span_s, count = taken_s[-1] - taken_s[0], index[-1] - index[0]
    expected = [int(layout.present.sum())] if rest is None else [int(one.sum()) for one in rest.expected]
    recent = past[-RECENT:]
    measured = [[one.measured[k] if one.measured else 0 for one in recent] for k in range(len(expected))]
    shares = [
        min(float(np.median(one)) / max(count, 1), 1.0) for one, count in zip(measured, expected, strict=True)
    ]
    light_bgr, blur_px = _medians(recent)
    gain = light_bgr / (np.full(3, np.nan) if rest is None else rest.light_bgr)
    moved = (
        []
        if rest is None
        else [
            motion_of(view.markers, one.xy_px, layout, limits.max_rest_error_px)
            for view, one in zip(newest.views, rest.markers, strict=False)
        ]
    )
    found = Health(
        frames_per_s=(len(past) - 1) / span_s if span_s > 0 else float("nan"),
        jitter_ms=float(np.std(steps_ms)) if len(steps_ms) > 1 else float("nan"),
        latency_ms=(float(np.median(latency)), float(np.percentile(latency, 99)), float(latency.max())),
        dropped=float(1 - (len(past) - 1) / count) if count else 0.0,
        share_read=min(shares, default=0.0),
        left_out=sum(int(layout.present.sum()) - one for one in expected),
        qualities=tuple(view.markers.quality for view in newest.views),
        light=float(gain.mean()),
        tint=tuple((gain / gain.mean()).tolist()),
        rest_error_px=max((one.way_px for one in moved), default=float("nan")),
        drift_px=max((one.drift_px for one in moved), default=float("nan")),
        events=events,
        advice=(),
    )
    blur_ratio = blur_px / (float("nan") if rest is None else rest.blur_px)
    return replace(found, advice=tuple(dict.fromkeys(_advice(found, newest, blur_px, blur_ratio, limits))))


def _advice(
    found: Health, newest: SensorFrame, blur_px: float, blur_ratio: float, limits: LimitsTable
) -> Iterator[str]:
    """What to do; a sentence of a property that is unknown, as NaN, is not said."""
    for quality in found.qualities:
        yield from quality.hints if quality is not None else ()
    if newest.reason:
        yield _reason_text(newest)
    elif found.share_read < limits.min_share_read:
        yield (
            f"clean the window: {found.share_read:.0%} of the markers at rest are measured, "
            f"{limits.min_share_read:.0%} are expected"
        )
    if blur_ratio > MAX_BLUR_RATIO:
        yield f"refocus: the blur is {blur_px:.1f} px, {blur_ratio:.1f} times that at rest"
    if found.light < MIN_LIGHT:
        yield f"check the light: the picture has {found.light:.0%} of its brightness at rest"
    tint = dict(zip(("blue", "green", "red"), found.tint, strict=True))
    name = max(tint, key=lambda one: tint[one])
    if tint[name] > MAX_TINT:
        yield (
            f"check the light, or fix the white balance: {name} is {tint[name]:.2f} times as strong as at rest, "
            "against the mean of all colors"
        )
    if found.drift_px > MAX_DRIFT_PX:
        yield f"zero the sensor: the untouched pattern has moved by {found.drift_px:.2f} px (RMS) since the rest frame"
    if found.dropped > 0.01:
        yield f"{found.dropped:.0%} of the frames have no result; ask for fewer frames a second, or fewer outputs"


def _reason_text(frame: SensorFrame) -> str:
    texts = [view.markers.reason.text for view in frame.views if view.markers.reason is not None]
    return "; ".join(dict.fromkeys(texts)) or frame.reason


class ToldAdvice:
    """Which advice is new: not told, or gone for a minute. Its figures may change."""

    def __init__(self) -> None:
        self._seen_s: dict[str, float] = {}

    def new(self, advice: Sequence[str]) -> list[str]:
        """Those of the present advice that are new; call it again and again."""
        now_s, found = time.monotonic(), []
        for one in advice:
            topic = re.sub(r"[\d.]+", "", one)
            if now_s - self._seen_s.get(topic, -TOLD_AGAIN_S) >= TOLD_AGAIN_S:
                found.append(one)
            self._seen_s[topic] = now_s
        return found
