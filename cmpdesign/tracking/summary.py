"""Statistics of a run of tracking, counted frame by frame."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmpdesign.reading.quality import median_quality, quality_to_json

if TYPE_CHECKING:
    from extractor.contact import ContactForce
    from extractor.layout.reference import Reference
    from extractor.quality import Quality
    from extractor.track.displacement import Rest
    from extractor.track.tracker import Tracked

AT_REST_PX = 0.2  # median displacement below which the pattern counts as resting
MIN_REST_PAIRS = 10  # least number of consecutive resting frames (pairs) for a jitter


class _LargestDisplacement(NamedTuple):
    """The largest displacement of a run with its frame and marker; -1 before the first displacement."""

    px: float = -1.0
    frame: int = -1
    marker: int = -1
    mm: float = float("nan")


class ContactStatistics:
    """The statistics of the contacts of frames."""

    def __init__(self) -> None:
        self._reasons: Counter[str] = Counter()
        self._largest: tuple[int, ContactForce] | None = None

    def add(self, frame: int, contact: ContactForce | None) -> None:
        """Count a frame's contact, if contacts are read."""
        if contact is None:
            return
        self._reasons[contact.reason.name.lower()] += 1
        press_n = -float(contact.force_n[2])
        if contact.regions and (self._largest is None or press_n > -self._largest[1].force_n[2]):
            self._largest = (frame, contact)

    def to_json(self) -> dict[str, Any] | None:
        """Numbers of frames by reason, and the frame with the largest press; None where no contact is read."""
        if not self._reasons:
            return None
        largest = None
        if self._largest is not None:
            frame, contact = self._largest
            sigma_n = np.sqrt(np.diag(contact.force_cov_n2))
            largest = {
                "frame": frame,
                "force_n": contact.force_n.tolist(),
                "force_sigma_n": sigma_n.tolist(),
                "regions": len(contact.regions),
            }
        return {"reasons": dict(sorted(self._reasons.items())), "largest": largest}


class TrackStatistics:
    """The statistics of a tracker's frames.

    Attributes:
        farthest: the frame of the largest displacement, for the quiver plot.
    """

    def __init__(self, reference: Reference) -> None:
        self._reference = reference
        self._elapsed_ms: list[float] = []
        self._statuses: Counter[str] = Counter()
        self._starts: Counter[str] = Counter()
        self._reasons: Counter[str] = Counter()
        self._markers = np.zeros(4, np.int64)
        self._qualities: list[Quality] = []
        self._resting: Tracked | None = None
        self._pairs, self._squares, self._values = 0, 0.0, 0
        self._contacts = ContactStatistics()
        self._largest = _LargestDisplacement()
        self.farthest: Tracked | None = None

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self._elapsed_ms)

    @property
    def tracked(self) -> int:
        """Number of tracked frames."""
        return self._statuses["tracked"]

    def add(self, frame: Tracked) -> None:
        """Count a frame."""
        self._elapsed_ms.append(frame.elapsed_ms)
        self._statuses[frame.status.name.lower()] += 1
        self._reasons[frame.reason] += 1
        self._starts[frame.start or "none"] += 1
        self._contacts.add(frame.index, frame.contact)
        self._markers += np.bincount(frame.markers.status[self._reference.present], minlength=4)
        if frame.markers.found and frame.markers.quality is not None:
            self._qualities.append(frame.markers.quality)
        self._add_motion(frame)

    def _add_motion(self, frame: Tracked) -> None:
        length = np.linalg.norm(frame.displacement_px, axis=1)
        if not np.isfinite(length).any():
            self._resting = None
            return
        marker = int(np.nanargmax(length))
        if length[marker] > self._largest.px:
            mm = float(np.linalg.norm(frame.displacement_mm[marker]))
            self._largest = _LargestDisplacement(float(length[marker]), frame.index, marker, mm)
            self.farthest = frame
        if np.nanmedian(length) >= AT_REST_PX:
            self._resting = None
            return
        if self._resting is not None:
            motion = frame.markers.xy_px - self._resting.markers.xy_px
            motion = motion[np.isfinite(motion)]
            self._pairs += 1
            self._squares += float(np.sum(motion**2))
            self._values += len(motion)
        self._resting = frame

    @property
    def jitter_px(self) -> float | None:
        """Standard deviation of a resting marker per axis, from frame to frame; None with too few resting frames."""
        if self._pairs < MIN_REST_PAIRS or not self._values:
            return None
        return float(np.sqrt(self._squares / self._values / 2))

    def to_json(self, source: str, declared: int | None, ended: str, rest: Rest | None) -> dict[str, Any]:
        """The summary as JSON values, see docs/how-to/tracking.md.

        Args:
            source: name of the source.
            declared: number of frames that the source declares, if any.
            ended: reason for an early end, or "".
            rest: the rest frame, if known.
        """
        total = max(int(self._markers.sum()), 1)
        lost, measured, repaired, fitted = (float(n) / total for n in self._markers)
        return {
            "format": "cmp-tracking",
            "version": 1,
            "source": source,
            "pattern": self._reference.pattern,
            "digest": self._reference.digest,
            "ended_early": ended or None,
            "frames": {
                "declared": declared,
                "read": self.frames,
                **{name: self._statuses[name] for name in ("tracked", "lost", "unreadable", "other_size")},
            },
            "reasons": {reason: count for reason, count in sorted(self._reasons.items()) if reason},
            "starts": {str(start): count for start, count in sorted(self._starts.items()) if start != "none"},
            "marker_shares": {"measured": measured, "repaired": repaired + fitted, "lost": lost},
            "time_ms": percentiles(self._elapsed_ms),
            "frames_per_s": 1e3 * self.frames / sum(self._elapsed_ms) if self.frames else None,
            "rest": _rest_json(rest),
            "quality": quality_to_json(median_quality(self._qualities)),
            "jitter_px": self.jitter_px,
            "jitter_pairs": self._pairs,
            "contact": self._contacts.to_json(),
            "largest_displacement": self._largest_json(),
        }

    def _largest_json(self) -> dict[str, Any] | None:
        largest = self._largest
        if largest.frame < 0:
            return None
        mm = largest.mm if np.isfinite(largest.mm) else None
        return {"px": largest.px, "mm": mm, "frame": largest.frame, "marker": largest.marker}


def percentiles(elapsed_ms: list[float]) -> dict[str, float]:
    """The 50th, 95th and 99th percentile; 0 without values."""
    values = np.percentile(elapsed_ms, (50, 95, 99)) if elapsed_ms else np.zeros(3)
    return dict(zip(("p50", "p95", "p99"), (float(v) for v in values), strict=True))


def _rest_json(rest: Rest | None) -> dict[str, Any] | None:
    if rest is None:
        return None
    residual = rest.residual_mm
    return {
        "markers": int(np.isfinite(rest.xy_px[:, 0]).sum()),
        "mm_per_px": rest.mm_per_px,
        "residual_mm": residual if np.isfinite(residual) else None,
    }
