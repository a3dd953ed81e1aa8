"""Force from one view: the displacement of the markers in the image, and how the view sees a displacement in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.contact import ContactReader
from extractor.layout.reference import Reference
from extractor.result import Markers
from extractor.space.camera import View
from extractor.space.pose import estimate_poses
from extractor.track.displacement import Rest
from extractor.track.tracker import FrameStatus, Tracked, Tracker


def seen_in_image(layout: Reference, view: View, rest: Markers) -> NDArray[np.float64]:
    """(M, 2, 3) px/mm: the displacement of each marker in the image by its displacement in space.

    Args:
        layout: the pad.
        view: its pose, if it has none, is estimated from the markers at rest.
        rest: the markers at rest in the whole image.

    Raises:
        PoseError: a pose that cannot be estimated.
    """
    xy_px, cov_px2 = rest.xy_px[None], rest.cov_px2[None]
    placed = estimate_poses([view], layout.xy_mm, xy_px, cov_px2, (0.0, 0.0, 0.0)).views[0]
    flat_mm = np.column_stack([layout.xy_mm, np.zeros(len(layout.xy_mm))])
    return placed.linearised(flat_mm).by_point


class ContactTracker:
    """A ``Tracker`` whose frames have a contact. A copy continues like the original.

    Args:
        tracker: a new tracker of one view.
        view: the camera; a pose that it lacks is estimated from the rest frame.
        contact: the reader of displacements in space; its gel, modulus and point are used.
        rest: the markers at rest, as the tracker's; None: the first tracked frame.

    Raises:
        PoseError: see ``seen_in_image``; without ``rest``, ``track`` raises it.
    """

    def __init__(
        self, tracker: Tracker, view: View, contact: ContactReader, rest: Markers | None = None
    ) -> None:
        self._tracker, self._view, self.contact = tracker, view, contact
        self.layout = tracker.layout
        self._reader: ContactReader | None = None
        self._rest_cov_px2: NDArray[np.float64] | None = None
        if rest is not None:
            self._set_rest(rest)

    @property
    def rest(self) -> Rest | None:
        """The rest frame, if known so far."""
        return self._tracker.rest

    def track(
        self, image: NDArray[Any] | Sequence[Any] | None, *, time_s: float = float("nan"), reason: str = ""
    ) -> Tracked:
        """Read the next frame; see ``Tracker.track``."""
        frame = self._tracker.track(image, time_s=time_s, reason=reason)  # type: ignore[arg-type]
        if self._reader is None and frame.status == FrameStatus.TRACKED:
            self._set_rest(frame.markers)
        if self._reader is None or self._rest_cov_px2 is None:
            unknown = np.full((len(self.layout.xy_mm), 3), np.nan)
            return replace(frame, contact=self.contact.read(unknown, unknown[..., None] * np.ones(3)))
        cov_px2 = frame.markers.cov_px2 + self._rest_cov_px2
        return replace(frame, contact=self._reader.read(frame.displacement_px, cov_px2))

    def _set_rest(self, rest: Markers) -> None:
        self._reader = self.contact.seen(seen_in_image(self.layout, self._view, rest))
        self._rest_cov_px2 = rest.cov_px2
