"""Several views in one image, as behind a pair of mirrors, or one image for each view: each view is read separately.

Force is read from several views in space, or from one view by how it sees a displacement in space.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.contact import ContactForce, ContactReader
from extractor.errors import ImageError
from extractor.image.input import Channels
from extractor.image.response import Response
from extractor.layout.layout_file import LayoutLike, layout_of
from extractor.layout.reference import Reference
from extractor.numeric.threads import Threads, available_cores
from extractor.pipeline import Extractor, Side, is_mirrored
from extractor.presets import Preset
from extractor.result import Markers
from extractor.space.camera import View
from extractor.space.pose import estimate_poses
from extractor.space.reconstruction import Reconstructor, Shape, appears_mirrored
from extractor.space.rig import Rig
from extractor.track.displacement import Rest
from extractor.track.tracker import FrameStatus, Tracked, Tracker

Image = NDArray[Any]


def crop_to_view(image: Any, view: View) -> Any:
    """The part of an image that a view fills.

    Raises:
        ImageError: not an image, or the area reaches beyond the image.
    """
    if view.area_px is None:
        return image
    x, y, width, height = view.area_px
    if not isinstance(image, np.ndarray) or image.ndim < 2:
        raise ImageError(
            f"view {view.name!r}: the image is {type(image).__name__}; give a numpy array (H, W, 3)"
        )
    if x + width > image.shape[1] or y + height > image.shape[0]:
        raise ImageError(
            f"view {view.name!r}: area_px {list(view.area_px)} reaches beyond the image of "
            f"{image.shape[1]} x {image.shape[0]} px"
        )
    return np.ascontiguousarray(image[y : y + height, x : x + width])


def _view_origin_px(view: View) -> tuple[float, float]:
    """The first pixel (x, y) of the view in the full image."""
    return (0.0, 0.0) if view.area_px is None else (float(view.area_px[0]), float(view.area_px[1]))


def _images_by_view(image: Image | Sequence[Image | None] | None, rig: Rig) -> list[Image | None]:
    """One image for every view."""
    if image is None or isinstance(image, np.ndarray):
        return [image] * len(rig.views)
    if len(image) != len(rig.views):
        raise ImageError(f"{len(image)} images; give one for all views, or one for each of {len(rig.views)}")
    return list(image)


def side_shown(layout: Reference, view: View, side: Side = "designed") -> Side:
    """The apparent side of a view's picture, for an ``Extractor``: by its pose, else by side and mirrors."""
    expected = is_mirrored(layout, side)
    if expected is None:
        return "either"
    mirrored = appears_mirrored(view) if view.placed else expected != view.mirrored
    return "back" if mirrored else "front"


class ViewExtractor:
    """Finds the markers of every view. Can be pickled and copied.

    Args:
        layout: a triangular pattern, as for ``Extractor``.
        rig: the views.
        preset, response, channels: see ``Extractor``.
        side: the side of the pattern that the views see, directly or through mirrors; see ``Extractor``. A view's
            pose in the rig has priority. "either": pictures of both sides are read.

    Raises:
        LayoutError: the layout is not a triangular pattern.
        ValueError: no such preset, response, side or order of channels.
    """

    def __init__(
        self,
        layout: LayoutLike,
        rig: Rig,
        preset: Preset = "balanced",
        response: Response | None = None,
        side: Side = "designed",
        channels: Channels = "bgr",
    ) -> None:
        layout = layout_of(layout)
        self.layout, self.rig = layout, rig
        self._sides = [side_shown(layout, view, side) for view in rig.views]
        self._extractors = {
            shown: Extractor(layout, preset, response, shown, channels)
            for shown in dict.fromkeys(self._sides)
        }

    def extract(self, image: Image | Sequence[Image]) -> tuple[Markers, ...]:
        """The markers view by view, in the frame of the full image.

        Args:
            image: one image with all views, or a sequence of one image for each view.

        Raises:
            ImageError: not an image, or smaller than a view's area.
        """
        found = []
        pictures = _images_by_view(image, self.rig)
        for view, shown, picture in zip(self.rig.views, self._sides, pictures, strict=True):
            markers = self._extractors[shown].extract(crop_to_view(picture, view))
            found.append(markers.moved(_view_origin_px(view)))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class ShapeFrame:
    """The result of one frame in space. Can be pickled and copied.

    Attributes:
        index: place in the sequence, from 0.
        time_s: time stamp in seconds; NaN where none was given.
        status: ``TRACKED`` when at least one marker has a position.
        reason: why not, or the view without a pattern; empty when all views show the pattern.
        shape: the surface.
        views: the tracked frame of every view.
        elapsed_ms: time from images to surface, and to the contact.
        contact: force, torque and regions; None without a ``ContactReader``.
    """

    index: int
    time_s: float
    status: FrameStatus
    reason: str
    shape: Shape
    views: tuple[Tracked, ...]
    elapsed_ms: float
    contact: ContactForce | None = None


class ShapeTracker:
    """Follows the surface through a sequence; a frame that cannot be read has a reason and keeps its place.

    A copy continues like the original.

    Args:
        reconstructor: with the poses of the views.
        warm: start from the previous frame where the image proves the prediction.
        preset, response, channels: see ``Extractor``. The views' poses determine the side that each view shows.
        contact: reads force, torque and regions of every frame; None: not wanted.
        threads: in which the views are read at the same time, with the same bits for any number; None: one for each
            view, at most one for each core.

    Raises:
        ValueError: no such preset, response or order of channels.
    """

    def __init__(
        self,
        reconstructor: Reconstructor,
        *,
        warm: bool = True,
        preset: Preset = "balanced",
        response: Response | None = None,
        channels: Channels = "bgr",
        contact: ContactReader | None = None,
        threads: int | None = None,
    ) -> None:
        self.reconstructor, self.contact = reconstructor, contact
        layout = reconstructor.layout
        most = min(len(reconstructor.rig.views), available_cores()) if threads is None else threads
        self._threads = Threads(most)
        sides = [side_shown(layout, view) for view in reconstructor.poses.views]
        self._trackers = [
            Tracker(layout, warm=warm, preset=preset, response=response, side=side, channels=channels)
            for side in sides
        ]
        self._count = 0

    def track(
        self, image: Image | Sequence[Image | None] | None, *, time_s: float = float("nan"), reason: str = ""
    ) -> ShapeFrame:
        """Read the next frame.

        Args:
            image: one image for all views or one for each view; None without an image, for ``reason``.
            time_s: time stamp of the frame.
        """
        started = time.perf_counter()
        rig = self.reconstructor.rig
        pictures = _images_by_view(image, rig)
        tracked = self._threads.results(
            [
                partial(self._track_view, view, tracker, picture, time_s, reason)
                for view, tracker, picture in zip(rig.views, self._trackers, pictures, strict=True)
            ]
        )
        markers = [frame.markers if frame.status == FrameStatus.TRACKED else None for frame in tracked]
        shape = self.reconstructor.reconstruct(markers)
        contact = None if self.contact is None else self.contact.read_shape(shape)
        found = bool(np.isfinite(shape.xyz_mm).any())
        worst = max((frame.status for frame in tracked), default=FrameStatus.LOST)
        status = FrameStatus.TRACKED if found else max(worst, FrameStatus.LOST)
        frame = ShapeFrame(
            index=self._count,
            time_s=time_s,
            status=FrameStatus(status),
            reason=_frame_reason(rig, tracked, shape, found),
            shape=shape,
            views=tuple(tracked),
            elapsed_ms=1e3 * (time.perf_counter() - started),
            contact=contact,
        )
        self._count += 1
        return frame

    def _track_view(
        self, view: View, tracker: Tracker, image: Image | None, time_s: float, reason: str
    ) -> Tracked:
        try:
            part = None if image is None else crop_to_view(image, view)
        except ImageError as error:
            part, reason = None, str(error)
        frame = tracker.track(part, time_s=time_s, reason=reason)
        return replace(frame, markers=frame.markers.moved(_view_origin_px(view)))


def _frame_reason(rig: Rig, tracked: Sequence[Tracked], shape: Shape, found: bool) -> str:
    """The reasons of the views, else the problem of the shape; empty without any."""
    reasons = [
        f"{name}: {frame.reason}" for name, frame in zip(rig.names, tracked, strict=True) if frame.reason
    ]
    if not reasons and shape.problem:
        reasons = [shape.problem]
    if not reasons and not found:
        reasons = ["the views have no reliable marker in common"]
    return "; ".join(reasons)


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
