"""Sources that run at the same time, one for each view, joined by time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median

from cmpdesign.inputs.cameras import CameraState
from cmpdesign.tracking.sources.frame_source import FrameSource, SourceFrame, SourceTimes

_STEPS = 32  # the last steps of a source, whose median is its step


@dataclass(eq=False)
class _View:
    """One source: its next frame, and its times on the common clock."""

    source: FrameSource
    frames: Iterator[SourceFrame] = field(init=False)
    head: SourceFrame | None = None
    shift_s: float = 0.0
    steps_s: deque[float] = field(default_factory=lambda: deque(maxlen=_STEPS))

    def __post_init__(self) -> None:
        self.frames = self.source.frames()
        self.advance()

    @property
    def time_s(self) -> float:
        return float("nan") if self.head is None else self.head.time_s + self.shift_s

    @property
    def step_s(self) -> float:
        """The time from frame to frame; 0 before it is known."""
        if self.source.fps:
            return 1 / self.source.fps
        return median(self.steps_s) if self.steps_s else 0.0

    def advance(self) -> None:
        before, self.head = self.head, next(self.frames, None)
        if before is not None and self.head is not None and self.head.time_s > before.time_s:
            self.steps_s.append(self.head.time_s - before.time_s)


class MultiViewSource:
    """Sources that run at the same time, one for each view; live ones end with the first that stops.

    Frames belong together if their times differ by at most half the shortest time from frame to frame. A frame without
    a partner is kept, with the reason in ``problem``. Sources without times are joined by number.
    """

    def __init__(self, sources: Sequence[FrameSource]) -> None:
        self._sources = list(sources)
        self.name, self.ended_early = " and ".join(source.name for source in sources), ""
        totals = [source.total for source in sources if source.total is not None]
        self.total = max(totals) if totals else None
        self.fps = sources[0].fps
        self.is_live = all(source.is_live for source in sources)
        self._within_s, self._alone = self._known_tolerance_s(), 0
        self._by_number = any(source.times.of == "none" for source in sources)

    def _known_tolerance_s(self) -> float:
        rates = [source.fps for source in self._sources if source.fps]
        return 0.5 / max(rates) if rates else 0.0

    @property
    def times(self) -> SourceTimes:
        """The times of the first view, and how the views are joined."""
        first = self._sources[0].times
        if self._by_number:
            joined = "views are joined by number, because one has no times"
        else:
            joined = f"views are joined by time, within {1e3 * self._within_s:.3g} ms"
        alone = f"; {self._alone} frames have no partner" if self._alone else ""
        texts = dict.fromkeys(source.times.text for source in self._sources)
        text = f"{'; '.join(texts)}; {joined}{alone}"
        is_doubtful = first.is_doubtful or self._by_number
        return SourceTimes(
            first.of,
            text,
            first.began_unix_s,
            first.began_of,
            first.camera_clock_s,
            first.origin,
            is_doubtful,
        )

    @property
    def notes(self) -> list[str]:
        return list(dict.fromkeys(note for source in self._sources for note in source.notes))

    @property
    def camera(self) -> tuple[CameraState, ...]:
        return tuple(state for source in self._sources for state in source.camera)

    def frames(self) -> Iterator[SourceFrame]:
        """Frames of all sources, with the first source's times; a missing image is None in the list."""
        views = [_View(source) for source in self._sources]
        self._align(views)
        ends_together, tail = all if self.is_live else any, 0
        shorter: list[str] = []
        while ends_together(view.head is not None for view in views):
            chosen = self._chosen(views)
            time_s = next(view.time_s for view, is_in in zip(views, chosen, strict=True) if is_in)
            problems, images = [], []
            for view, is_in in zip(views, chosen, strict=True):
                frame = view.head if is_in else None
                images.append(frame.image if frame else None)
                if frame is None:
                    limit = f"within {1e3 * self._within_s:.3g} ms"
                    problems.append(f"{view.source.name} has no frame {limit} of this one")
                elif frame.problem:
                    problems.append(frame.problem)
            self._alone += not all(chosen)
            tail += any(view.head is None for view in views)
            shorter = shorter or [view.source.name for view in views if view.head is None]
            yield SourceFrame(time_s, images, "; ".join(problems))
            for view, is_in in zip(views, chosen, strict=True):
                if is_in:
                    view.advance()
        reasons = [source.ended_early for source in self._sources if source.ended_early]
        if tail > 1 and not reasons:
            reasons = [f"{' and '.join(shorter)} has fewer frames than the others"]
        self.ended_early = "; ".join(reasons)

    def _align(self, views: Sequence[_View]) -> None:
        """Put the sources on one clock, if they have one: that of their names, or of this computer."""
        origins = [view.source.times.origin for view in views]
        names = {None if origin is None else origin[0] for origin in origins}
        if len(names) == 1 and None not in names:
            for view, origin in zip(views, origins, strict=True):
                view.shift_s = origin[1] - origins[0][1] if origin and origins[0] else 0.0

    def _chosen(self, views: Sequence[_View]) -> list[bool]:
        """The views whose next frames belong together: the earliest one, and those within half a step of it."""
        here = [view.head is not None for view in views]
        times_s = [
            view.time_s if is_here else float("inf") for view, is_here in zip(views, here, strict=True)
        ]
        if self._by_number or any(time_s != time_s for time_s in times_s):
            return here
        steps_s = [view.step_s for view in views if view.step_s > 0]
        self._within_s = 0.5 * min(steps_s) if steps_s else float("inf")
        first_s = min(times_s)
        return [
            is_here and time_s - first_s <= self._within_s
            for time_s, is_here in zip(times_s, here, strict=True)
        ]
