"""Tracking: every frame is numbered independently, so that there is no drift; the previous frame only saves time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor._native import track as native
from extractor.contact import ContactForce
from extractor.errors import ImageError
from extractor.frozen_record import LateRecord
from extractor.image.input import Channels
from extractor.image.pyramid import Pyramid, PyramidLevel
from extractor.image.response import Response
from extractor.layout.layout_file import LayoutLike, layout_of
from extractor.pipeline import ImageReader, NumberedMarkers, Side, Stages, no_markers
from extractor.presets import Preset
from extractor.refine.estimate import Appearance
from extractor.refine.measure.gridline_weights import SHORTEST_RARITY, short_edge
from extractor.result import Markers, Origin, Reason, Status
from extractor.track.displacement import NO_REST, Rest, fit_rest
from extractor.track.warm_start import SeenCells, TrackState, WarmStart, seen_cells
from extractor.track.warm_tables import WarmTables, build_warm_tables

MIN_KEPT_SHARE = 0.97  # of the markers of the last cold start; with fewer, a cold start may find more. Chosen
WARM_EDGE_PX = 8.0  # edges at the scale of a warm start are this long, or up to twice; chosen
# one of this number of edges is measured for the choice of that scale; chosen, for time
EDGE_SAMPLING_STEP = 8
COLD_START_INTERVAL = 200  # frames after which a cold start is done; chosen
# Warm passes over the image of a cold start. Warm frames start from levels and blur of the frame before: without these
# passes, equal frames after a cold start differ from it by 0.18 stated standard deviations (median), with two by 0.04.
SETTLING_PASSES = 2


class FrameStatus(IntEnum):
    """The outcome of a frame; every frame has one."""

    TRACKED = 1
    LOST = 2  # read, but the pattern was not found; ``reason`` states the cause
    UNREADABLE = 3  # no image
    OTHER_SIZE = 4  # not of the first frame's size


class StartKind(StrEnum):
    """How a frame's numbering was found."""

    COLD = "cold"  # without the previous frame
    WARM = "warm"  # predicted from the previous frame, proved by the white cell
    RIM = "warm, by the rim"  # predicted, proved by the pattern's whole rim, as the white cell is hidden


@dataclass(frozen=True, eq=False)
class Tracked(LateRecord):
    """The result of one frame. Displacements are computed when they are first asked for.

    Attributes:
        index: place in the sequence, from 0.
        time_s: time stamp in seconds; NaN where none was given.
        status: outcome of the frame.
        reason: why the frame is not tracked, or why few of its markers are found; else empty.
        start: how the numbering was found; None without a numbering.
        markers: the markers, all lost where the frame is not tracked.
        displacement_px: (M, 2) float64 from the rest frame in the image frame (x right, y down), NaN where unknown.
        displacement_mm: (M, 2) float64 in the layout frame (y up), NaN where unknown; see ``Rest``.
        elapsed_ms: time from image to markers.
        contact: force, torque and regions, of a ``ContactTracker``; else None.
    """

    index: int
    time_s: float
    status: FrameStatus
    reason: str
    start: StartKind | None
    markers: Markers
    displacement_px: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]
    elapsed_ms: float
    contact: ContactForce | None = None

    def __repr__(self) -> str:
        reason = f"; {self.reason}" if self.reason else ""
        return f"<Tracked {self.index}: {self.status.name.lower()}, {self.markers}{reason}>"


class Tracker:
    """Follows one pattern through a sequence of images of one size. A copy continues like the original.

    >>> from extractor import Tracker
    >>> tracker = Tracker("layout.json")  # doctest: +SKIP
    >>> frame = tracker.track(image, time_s=0.04)  # doctest: +SKIP

    Args:
        layout: a triangular pattern, as for ``Extractor``.
        rest: markers at rest; None: the first tracked frame.
        mm_per_px: a scale for millimetres along the image's axes; None: millimetres in the layout frame, by a
            homography fitted at rest.
        warm: start from the previous frame where the image proves the prediction; False: always cold. Ids are the same.
        preset, response, side, channels: see ``Extractor``.

    Raises:
        LayoutError: the layout is not a triangular pattern.
        ValueError: no such preset, response, side or order of channels.
    """

    def __init__(
        self,
        layout: LayoutLike,
        *,
        rest: Markers | None = None,
        mm_per_px: float | None = None,
        warm: bool = True,
        preset: Preset = "balanced",
        response: Response | None = None,
        side: Side = "designed",
        channels: Channels = "bgr",
    ) -> None:
        self.layout = layout = layout_of(layout)
        self.rest: Rest | None = None
        self._reader = ImageReader(layout, preset, response, side, channels)
        self._mm_per_px = mm_per_px
        self._tables: WarmTables | None = build_warm_tables(layout) if warm else None
        self._sampled_edges = np.ascontiguousarray(layout.edges[::EDGE_SAMPLING_STEP])
        self._state: TrackState | None = None
        self._size: tuple[int, ...] | None = None
        self._count = 0
        if rest is not None:
            self.rest = fit_rest(rest.xy_px, layout, mm_per_px)

    def track(self, image: NDArray[Any] | None, *, time_s: float = float("nan"), reason: str = "") -> Tracked:
        """Read the next frame; a frame that cannot be tracked has a reason and keeps its place in the sequence.

        Args:
            image: as for ``Extractor.extract``; None without an image, for ``reason``.
            time_s: time stamp of the frame.
        """
        started = time.perf_counter()
        markers, status, start = None, FrameStatus.UNREADABLE, None
        try:
            if image is None:
                reason = reason or "no image"
            elif self._size not in (None, np.shape(image)[:2]):
                status, reason = FrameStatus.OTHER_SIZE, self._size_mismatch_text(image)
            else:
                markers, start = self._read(image)
                self._size = self._size or image.shape[:2]
                reason = markers.reason or ""
                status = FrameStatus.TRACKED if markers.found else FrameStatus.LOST
        except ImageError as error:
            reason = str(error)
        markers = markers or no_markers(self.layout, Reason.NO_PATTERN, Stages())
        elapsed_ms = 1e3 * (time.perf_counter() - started)
        if status == FrameStatus.TRACKED and self.rest is None:
            self.rest = fit_rest(markers.xy_px, self.layout, self._mm_per_px)
        return self._make_tracked(time_s, status, reason, start, markers, elapsed_ms)

    def _read(self, image: NDArray[Any]) -> tuple[Markers, StartKind | None]:
        """The markers of an image by a warm or a cold start, and the kind of start; None without markers."""
        stages = Stages()
        pyramid = self._reader.pyramid(image, stages)
        warm = self._try_warm_start(pyramid, stages)
        if warm is not None:
            return warm
        markers, appearance = self._reader.read_pyramid(pyramid, stages)
        if not markers.found or appearance is None:
            if (
                self._state is not None
            ):  # the next frame may start from these positions, but not from velocities
                self._state = self._state._replace(previous_px=None, is_before_gap=True)
            return markers, None
        if self._tables is not None and pyramid is not None:
            view = self._level_of_check(pyramid, markers.xy_px)
            cells = seen_cells(view, markers.xy_px, self._tables)
            self._update_state(markers, appearance, cells, _measured(markers), None)
            markers = self._settle(pyramid, markers)
        return markers, StartKind.COLD

    def _settle(self, pyramid: Pyramid, markers: Markers) -> Markers:
        """The markers of a cold start after warm passes over the same image, so that equal frames agree; the markers
        as they are where the image does not prove them. The state keeps the motion from the previous frame."""
        cold = self._state
        for _ in range(SETTLING_PASSES):
            stages = Stages()
            stages.record("image", pyramid.level(1).image)
            warm = self._try_warm_start(pyramid, stages)
            if warm is None or cold is None or self._state is None:
                break
            markers = warm[0]
            self._state = self._state._replace(previous_px=cold.previous_px, frames_since_cold=0)
        return markers

    def _try_warm_start(self, pyramid: Pyramid | None, stages: Stages) -> tuple[Markers, StartKind] | None:
        """The markers of a warm start, or None where the image does not prove the prediction."""
        state, tables = self._state, self._tables
        if state is None or tables is None or state.frames_since_cold >= COLD_START_INTERVAL:
            return None
        if pyramid is None:
            return None
        view = self._level_of_check(pyramid, state.xy_px)
        start = stages.record("prove", native.warm_start(view, state, tables))
        return None if start is None else self._refine_warm_start(pyramid, start, stages)

    def _level_of_check(self, pyramid: Pyramid, xy_px: NDArray[np.float64]) -> PyramidLevel:
        """The image at the scale at which predictions are checked, for markers (M, 2), px."""
        edge_px = short_edge(xy_px, self._sampled_edges, SHORTEST_RARITY)
        return pyramid.level(1 << max(int(np.log2(max(edge_px / WARM_EDGE_PX, 1.0))), 0))

    def _refine_warm_start(
        self, pyramid: Pyramid, start: WarmStart, stages: Stages
    ) -> tuple[Markers, StartKind] | None:
        """The refined markers, moved by at most a quarter of an edge; None where too few of them are measured."""
        state, tables = self._state, self._tables
        assert state is not None and tables is not None
        numbered = NumberedMarkers(
            start.places, state.mirrored, Origin.PREVIOUS if start.by_rim else Origin.WHITE
        )
        before = state.appearance._replace(levels=start.ink_levels)
        markers, appearance = self._reader.finish(pyramid, numbered, stages, before)
        known = _measured(markers)
        if appearance is None or np.count_nonzero(known) < MIN_KEPT_SHARE * state.expected_count:
            return None
        self._update_state(markers, appearance, start.cells, known, state)
        return markers, StartKind.RIM if start.by_rim else StartKind.WARM

    def _update_state(
        self,
        markers: Markers,
        appearance: Appearance,
        cells: SeenCells,
        known: NDArray[np.bool_],
        start: TrackState | None,
    ) -> None:
        """Keep a frame; start is the state that it started from, None for a cold start."""
        last, count = self._state, int(np.count_nonzero(known))
        if last is not None:
            # cells above or below the black: the parallax of the first frame, also after a cold start
            appearance = appearance._replace(parallax=last.appearance.parallax)
        self._state = TrackState(
            xy_px=markers.xy_px,
            known=known,
            previous_px=last.xy_px if last is not None and not last.is_before_gap else None,
            cells=cells,
            appearance=appearance,
            mirrored=bool(markers.mirrored),
            expected_count=count if start is None else max(count, start.expected_count),
            frames_since_cold=0 if start is None else start.frames_since_cold + 1,
        )

    def _make_tracked(
        self,
        time_s: float,
        status: FrameStatus,
        reason: str,
        start: StartKind | None,
        markers: Markers,
        elapsed_ms: float,
    ) -> Tracked:
        rest = self.rest or NO_REST
        frame = Tracked.with_later(
            {
                ("displacement_px",): lambda: [rest.displacement_px(markers.xy_px)],
                ("displacement_mm",): lambda: [rest.displacement_mm(markers.xy_px)],
            },
            index=self._count,
            time_s=time_s,
            status=status,
            reason=reason,
            start=start,
            markers=markers,
            elapsed_ms=elapsed_ms,
        )
        self._count += 1
        return frame

    def _size_mismatch_text(self, image: NDArray[Any]) -> str:
        height, width = np.shape(image)[:2]
        assert self._size is not None
        return f"{width} x {height} px instead of {self._size[1]} x {self._size[0]} px"


def _measured(markers: Markers) -> NDArray[np.bool_]:
    """(M,) the markers that are measured."""
    return np.asarray(markers.status == Status.MEASURED.value)
