"""Tracking: frame after frame, each numbered in itself, so that nothing drifts; the frame before only saves time."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.errors import ImageError
from extractor.image.input import convert_to_bgr
from extractor.image.pyramid import Pyramid
from extractor.layout.reference import Reference
from extractor.pipeline import Extractor, Stages
from extractor.refine.estimate import Appearance
from extractor.refine.measure.gridline_weights import SHORTEST_RARITY, short_edges
from extractor.result import Markers, Origin, Reason, Status
from extractor.track.displacement import Rest, fit_rest
from extractor.track.image_check import check_cells
from extractor.track.warm_start import WarmStart, select_prediction, verify_prediction
from extractor.track.warm_tables import WarmTables, build_warm_tables, predict_missing_markers

MIN_KEPT_SHARE = 0.97  # of the markers of the last cold start; below it, a cold start may find more
WARM_EDGE_PX = (
    8.0  # a warm start looks at the image at a scale that leaves edges of so many px, or up to twice
)
EDGE_SAMPLING_STEP = 8  # edges of the layout; one of so many is looked at for that
COLD_START_INTERVAL = 200  # frames; a cold start at least this often


class FrameStatus(IntEnum):
    """What became of a frame. None vanishes."""

    TRACKED = 1
    LOST = 2  # read, but the pattern was not found; ``reason`` says why
    UNREADABLE = 3  # no image could be had
    OTHER_SIZE = 4  # not as large as the first frame


class StartKind(StrEnum):
    """How a frame's numbering was found."""

    COLD = "cold"  # without the frame before
    WARM = "warm"  # predicted from the frame before, proved by the white cell
    RIM = "warm, by the rim"  # white cell hidden: predicted, proved by the whole rim of the pattern


@dataclass(frozen=True, eq=False)
class Tracked:
    """One frame.

    Attributes:
        index: its place in the sequence, from 0.
        time_s: its time stamp in seconds; NaN where none was given.
        status: what became of it.
        reason: why it is not tracked, in words; empty when it is.
        start: how its numbering was found; None where there is none.
        markers: the markers, all lost where the frame is not tracked.
        displacement_px: (M, 2) float64 against the rest frame in the image frame (x right, y down), NaN where unknown.
        displacement_mm: (M, 2) float64 in the layout frame (y up), NaN where unknown; see ``Rest``.
        elapsed_ms: what it took, image to markers.
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


@dataclass(frozen=True, eq=False)
class _TrackState:
    """What a frame leaves to the next: positions, which of them were measured, those before, every cell's look, and how
    the image looks to refinement."""

    xy_px: NDArray[np.float64]
    known: NDArray[np.bool_]
    previous_px: NDArray[np.float64] | None
    cell_levels: NDArray[np.float64]
    seen: Appearance | None
    mirrored: bool
    expected_count: int  # markers of the last cold start, or more
    frames_since_cold: int  # frames since
    gap: bool = False  # the frame after was lost


class Tracker:
    """Follows one pattern through a sequence of images of one size.

    >>> from extractor import Tracker, load_layout
    >>> tracker = Tracker(load_layout("layout.json"))  # doctest: +SKIP
    >>> frame = tracker.track(image, time_s=0.04)  # doctest: +SKIP

    Args:
        layout: a triangular pattern.
        rest: markers at rest; None: the first tracked frame.
        mm_per_px: a scale for millimetres along the image's axes; None: millimetres in the layout frame, through
            a homography fitted at rest.
        warm: start from the frame before where the image proves it; False: always cold. The ids are the same.

    Raises:
        LayoutError: the layout is not a triangular pattern.
    """

    def __init__(
        self,
        layout: Reference,
        *,
        rest: Markers | None = None,
        mm_per_px: float | None = None,
        warm: bool = True,
    ) -> None:
        self.layout = layout
        self.rest: Rest | None = None
        self._extractor = Extractor(layout)
        self._mm_per_px = mm_per_px
        self._tables: WarmTables | None = build_warm_tables(layout) if warm else None
        self._sampled_edges = np.ascontiguousarray(layout.edges[::EDGE_SAMPLING_STEP])
        self._state: _TrackState | None = None
        self._size: tuple[int, ...] | None = None
        self._count = 0
        if rest is not None:
            self.rest = fit_rest(rest.xy_px, layout, mm_per_px)

    def track(self, image: NDArray[Any] | None, *, time_s: float = float("nan"), reason: str = "") -> Tracked:
        """The next frame, whatever it holds: a frame that cannot be tracked says so and keeps its place.

        Args:
            image: as for ``Extractor.extract``; None where none could be had, for ``reason``.
            time_s: its time stamp.
        """
        started = time.perf_counter()
        markers, status, start = None, FrameStatus.UNREADABLE, None
        try:
            if image is None:
                reason = reason or "no image"
            elif self._size not in (None, np.shape(image)[:2]):
                status, reason = FrameStatus.OTHER_SIZE, self._size_mismatch_text(image)
            else:
                markers, start = self._find(image)
                self._size = self._size or image.shape[:2]
                reason = markers.reason or ""
                status = FrameStatus.LOST if markers.reason else FrameStatus.TRACKED
        except ImageError as error:
            reason = str(error)
        markers = markers or self._extractor._no_markers(Reason.NO_PATTERN, Stages())
        elapsed_ms = 1e3 * (time.perf_counter() - started)
        if status == FrameStatus.TRACKED and self.rest is None:
            self.rest = fit_rest(markers.xy_px, self.layout, self._mm_per_px)
        return self._make_tracked(time_s, status, reason, start, markers, elapsed_ms)

    def _find(self, image: NDArray[Any]) -> tuple[Markers, StartKind | None]:
        found = self._try_warm_start(image)
        if found is not None:
            return found
        markers = self._extractor.extract(image)
        if markers.reason is not None:
            if self._state is not None:  # positions are worth another try, velocities are not
                self._state = replace(self._state, previous_px=None, gap=True)
            return markers, None
        bgr = convert_to_bgr(image)
        if self._tables is not None and bgr is not None:
            corner_px = markers.xy_px[self._tables.corners]
            look = _fill_unseen_levels(
                check_cells(bgr, corner_px, self._tables, None).cell_levels, self._tables
            )
            count = int((markers.status == Status.MEASURED).sum())
            self._update_state(markers, look, count, 0)
        return markers, StartKind.COLD

    def _try_warm_start(self, image: NDArray[Any]) -> tuple[Markers, StartKind] | None:
        """The markers of a warm start, or None where it is not proved."""
        memory, tables = self._state, self._tables
        if memory is None or tables is None or memory.frames_since_cold >= COLD_START_INTERVAL:
            return None
        stages = Stages()
        bgr = stages.record("image", convert_to_bgr(image))
        if bgr is None:
            return None
        sights = Pyramid(bgr)
        edge_px = float(short_edges(memory.xy_px, self._sampled_edges, SHORTEST_RARITY, SHORTEST_RARITY)[0])
        view = sights.at(1 << max(int(np.log2(max(edge_px / WARM_EDGE_PX, 1.0))), 0))
        guesses = [view.reduced(memory.xy_px)]
        if memory.previous_px is not None:
            moving = view.reduced(2 * memory.xy_px - memory.previous_px)
            guesses.append(np.where(np.isfinite(moving), moving, guesses[0]))
        predicted = stages.record(
            "predict", select_prediction(view.image, guesses, tables, memory.cell_levels)
        )
        if predicted is None:
            return None
        start = verify_prediction(
            view, predict_missing_markers(tables, predicted), memory.known, tables, memory.cell_levels
        )
        if stages.record("prove", start) is None:
            return None
        assert start is not None
        return self._refine_warm_start(sights, start, stages)

    def _refine_warm_start(
        self, sights: Pyramid, start: WarmStart, stages: Stages
    ) -> tuple[Markers, StartKind] | None:
        """Refined, which moves no marker by more than a quarter of an edge; None where too few are left."""
        memory = self._state
        assert memory is not None
        origin = Origin.PREVIOUS if start.by_rim else Origin.WHITE
        seen = memory.seen and memory.seen.with_lighting(memory.cell_levels, start.cell_levels)
        markers = self._extractor.finish(sights, start.places, memory.mirrored, origin, stages, seen)
        count = int((markers.status == Status.MEASURED).sum())
        if count < MIN_KEPT_SHARE * memory.expected_count:
            return None
        self._update_state(
            markers, start.cell_levels, max(count, memory.expected_count), memory.frames_since_cold + 1
        )
        return markers, StartKind.RIM if start.by_rim else StartKind.WARM

    def _update_state(self, markers: Markers, look: NDArray[np.float64], expected: int, age: int) -> None:
        last = self._state
        before = last.xy_px if last is not None and not last.gap else None
        known = markers.status == Status.MEASURED
        seen = markers.stages["refine"].appearance
        self._state = _TrackState(
            markers.xy_px, known, before, look, seen, bool(markers.mirrored), expected, age
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
        unknown = np.full_like(markers.xy_px, np.nan)
        frame = Tracked(
            index=self._count,
            time_s=time_s,
            status=status,
            reason=reason,
            start=start,
            markers=markers,
            displacement_px=unknown if self.rest is None else self.rest.displacement_px(markers.xy_px),
            displacement_mm=unknown if self.rest is None else self.rest.displacement_mm(markers.xy_px),
            elapsed_ms=elapsed_ms,
        )
        self._count += 1
        return frame

    def _size_mismatch_text(self, image: NDArray[Any]) -> str:
        height, width = np.shape(image)[:2]
        assert self._size is not None
        return f"{width} x {height} px instead of {self._size[1]} x {self._size[0]} px"


def _fill_unseen_levels(look: NDArray[np.float64], tables: WarmTables) -> NDArray[np.float64]:
    """Cells that were not seen look like the mean of their ink."""
    seen = np.isfinite(look[0, :, 0])
    for ink in (1, 2, 3):
        mine = tables.ink == ink
        mean = look[:, mine & seen].mean(axis=1, keepdims=True) if (mine & seen).any() else 0.0
        look[:, mine & ~seen] = mean
    return look
