"""Statistics of a run of reconstruction, counted frame by frame."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmpdesign.tracking.summary import ContactStatistics, percentiles

if TYPE_CHECKING:
    from extractor.space.reconstruction import Reconstructor
    from extractor.space.views import ShapeFrame


class _LargestDisplacement(NamedTuple):
    """The largest displacement of a run with its frame and marker; -1 before the first displacement."""

    mm: float = -1.0
    frame: int = -1
    marker: int = -1


class ShapeStatistics:
    """The statistics of a reconstructor's frames.

    Args:
        reconstructor: the reconstructor of the frames.
        marker_depth_mm: depth of the pattern below the touched surface; None: not known.
        is_continued: the table holds the touched surface, too.
    """

    def __init__(
        self, reconstructor: Reconstructor, marker_depth_mm: float | None = None, is_continued: bool = False
    ) -> None:
        self._reconstructor = reconstructor
        self._marker_depth_mm, self._is_continued = marker_depth_mm, is_continued
        self._present = reconstructor.layout.present
        self._elapsed_ms: list[float] = []
        self._statuses: Counter[str] = Counter()
        self._reasons: Counter[str] = Counter()
        self._markers = np.zeros(4, np.int64)
        self._lost: Counter[int] = Counter()
        self._sigmas_um: list[np.ndarray] = []
        self._largest = _LargestDisplacement()
        self._systematic_um: list[float] | None = None
        self._contacts = ContactStatistics()

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self._elapsed_ms)

    @property
    def tracked(self) -> int:
        """Number of tracked frames."""
        return self._statuses["tracked"]

    def add(self, frame: ShapeFrame) -> None:
        """Count a frame."""
        shape = frame.shape
        self._elapsed_ms.append(frame.elapsed_ms)
        self._statuses[frame.status.name.lower()] += 1
        self._reasons[frame.reason] += 1
        self._contacts.add(frame.index, frame.contact)
        self._markers += np.bincount(shape.status[self._present], minlength=4)
        self._lost.update(shape.reason[self._present & (shape.status == 0)].tolist())
        known = shape.status != 0
        if not known.any():
            return
        variances = shape.cov_mm2[known][:, [0, 1, 2], [0, 1, 2]]
        self._sigmas_um.append(1e3 * np.sqrt(np.median(variances, axis=0)))
        length = np.linalg.norm(shape.displacement_mm, axis=1)
        if np.isfinite(length).any() and np.nanmax(length) > self._largest.mm:
            self._largest = _LargestDisplacement(
                float(np.nanmax(length)), frame.index, int(np.nanargmax(length))
            )
            if self._reconstructor.rig.independent_deviations:
                self._systematic_um = (1e3 * shape.displacement_systematic_mm[self._largest.marker]).tolist()

    def to_json(self, source: str, declared: int | None, ended: str) -> dict[str, Any]:
        """The summary as JSON values, see docs/how-to/reconstruction.md.

        Args:
            source: name of the source.
            declared: number of frames that the source declares, if any.
            ended: reason for an early end, or "".
        """
        from extractor import PointReason

        layout, poses = self._reconstructor.layout, self._reconstructor.poses
        total = max(int(self._markers.sum()), 1)
        lost, measured, repaired, fitted = (float(n) / total for n in self._markers)
        sigmas = np.median(self._sigmas_um, axis=0).tolist() if self._sigmas_um else None
        return {
            "format": "cmp-reconstruction",
            "version": 1,
            "source": source,
            "pattern": layout.pattern,
            "digest": layout.digest,
            "ended_early": ended or None,
            "frames": {
                "declared": declared,
                "read": self.frames,
                **{name: self._statuses[name] for name in ("tracked", "lost", "unreadable", "other_size")},
            },
            "reasons": {reason: count for reason, count in sorted(self._reasons.items()) if reason},
            "marker_shares": {"measured": measured, "repaired": repaired + fitted, "lost": lost},
            "lost_markers": {
                PointReason(code).name.lower(): count for code, count in sorted(self._lost.items()) if code
            },
            "sigma_um": sigmas,
            "systematic_um": self._systematic_um,
            "time_ms": percentiles(self._elapsed_ms),
            "views": [
                {"name": view.name, "position_mm": view.position_mm.tolist(), "rms_px": float(rms)}
                for view, rms in zip(poses.views, poses.rms_px, strict=True)
            ],
            "model_px": self._reconstructor.model_px,
            "warnings": list(self._reconstructor.warnings),
            "positions": {
                "of": "pattern",
                "depth_mm": self._marker_depth_mm,
                "continued_to_surface": self._is_continued,
            },
            "contact": self._contacts.to_json(),
            "largest_displacement": None if self._largest.frame < 0 else self._largest._asdict(),
        }
