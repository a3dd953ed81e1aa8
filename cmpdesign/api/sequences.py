"""Sequences followed into files: ``track`` and ``reconstruct`` of the command line, and their files read back."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from cmpdesign.api.layouts import reference_from
from cmpdesign.errors import CmpDesignError, OutputError, parameter
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.tracking.live.options import Live, LiveKind
from cmpdesign.tracking.recording.options import DEFAULT_FRAME_ID, Recording
from cmpdesign.tracking.shape_options import ShapeOptions as ShapeOptions

if TYPE_CHECKING:
    from cmpdesign.contact.continuation import SurfaceContinuation
    from cmpdesign.contact.elastomer import Elastomer
    from cmpdesign.layout.layout import Layout as AnyLayout
    from cmpdesign.tracking.export.runs import Run
    from cmpdesign.tracking.run import TrackingRun
    from cmpdesign.tracking.sources import FrameSource
    from extractor import LayoutLike, Reference
    from extractor.contact import ContactReader
    from extractor.image.input import Channels
    from extractor.image.response import Response
    from extractor.pipeline import Side
    from extractor.presets import Preset

AnySource = str | Path | int | Sequence[str | Path]


class ReadingOptions(TypedDict, total=False):
    """How frames are read; options of ``track`` and ``reconstruct``.

    Keys:
        fps: frames per second; None: a video's own, 30 for a folder.
        frames: stop after this many frames; None: at the source's end.
        cold: number every frame without the previous frame; False.
        preset, response, side, channels: see ``extractor.Extractor``.
        max_pixels: largest image that is read, width x height.
        frame_id: coordinate frame and first part of the topics of a recording; "tactile".
        with_images: also record the frames' images, or show them live; False.
        live: also show the frames during the run, by "foxglove" or "rerun"; None.
        live_port, live_wait_s: see ``Live``; None and 0.
        times: times of pictures by "names" or "index", or a file .csv of FRAME,SECONDS; None: what the names say.
    """

    fps: float | None
    frames: int | None
    cold: bool
    preset: Preset
    response: Response | None
    side: Side
    channels: Channels
    max_pixels: int
    frame_id: str
    with_images: bool
    live: LiveKind | None
    live_port: int | None
    live_wait_s: float
    times: str | None


@dataclass(frozen=True)
class Reading:
    """``ReadingOptions`` with their defaults.

    Raises:
        CmpDesignError: a rate or a number of frames that is not above 0, a frame id that no topic can have, or a live
            server that cannot be.
    """

    fps: float | None = None
    frames: int | None = None
    cold: bool = False
    preset: Preset = "balanced"
    response: Response | None = None
    side: Side = "designed"
    channels: Channels = "bgr"
    max_pixels: int = MOST_PIXELS
    frame_id: str = DEFAULT_FRAME_ID
    with_images: bool = False
    live: LiveKind | None = None
    live_port: int | None = None
    live_wait_s: float = 0.0
    times: str | None = None

    def __post_init__(self) -> None:
        _require_positive("fps", self.fps)
        _require_positive("frames", self.frames)
        _ = self.recording, self.viewer

    @property
    def recording(self) -> Recording:
        return Recording(self.frame_id, self.with_images)

    @property
    def viewer(self) -> Live | None:
        """The live server's options."""
        if self.live is not None:
            return Live(self.live, self.live_port, self.live_wait_s)
        if self.live_port is not None or self.live_wait_s:
            port, wait, needed = map(parameter, ("live_port", "live_wait_s", "live"))
            raise CmpDesignError(f"{port} and {wait} need {needed}")
        return None


@dataclass(frozen=True, eq=False)
class Followed:
    """A sequence that was followed.

    Attributes:
        output: the table or recording; ``cmpdesign.load_run`` reads an .npz file.
        written: all files that were written, ``output`` first.
        summary: the JSON object of the summary beside it; empty if no frame could be read.
        ended_early: why the run ended before the source's end; "" for a complete run.
        warnings: reasons to doubt the results.
    """

    output: Path
    written: tuple[Path, ...]
    summary: Mapping[str, Any]
    ended_early: str
    warnings: tuple[str, ...] = ()


def track(
    layout: LayoutLike | AnyLayout,
    source: AnySource,
    output: str | Path,
    *,
    rest: str | Path | int | None = None,
    mm_per_px: float | None = None,
    overlay: str | Path | None = None,
    quiver: str | Path | None = None,
    watch: Callable[[Any], None] = lambda frame: None,
    **reading: Unpack[ReadingOptions],
) -> Followed:
    """Follow a pattern through a video, a folder or a camera into a table, as the command ``track`` does.

    >>> followed = cmpdesign.track("layout.json", "press.mp4", "run.npz", rest=0)
    >>> run = cmpdesign.load_run("run.npz")
    >>> run.arrays["displacement_mm"].shape               # (F, M, 2)

    For markers frame by frame without a file, use ``cmpdesign.open_source`` and ``extractor.Tracker``.

    Args:
        layout: a layout, the path of a layout file, a ``Reference``, or the JSON object of a layout file.
        source: see ``open_source``.
        output: table (.npz, .parquet, .csv), or recording (.mcap; without ending a rosbag2 folder).
        rest: number of the frame at rest, or an image; None: the first tracked frame.
        mm_per_px: scale for mm along the image's axes; None: mm in the layout's frame.
        overlay: video of the found markers (.mp4, .avi, .mkv).
        quiver: picture (.png) with arrows of the frame with the largest displacement.
        watch: called with every ``extractor.Tracked``.
        reading: see ``ReadingOptions``.

    Raises:
        CmpDesignError: a source, an image at rest or an option that cannot be used; nothing is written.
        OutputError: a file cannot be written; the frames so far are complete.
    """
    job = TrackJob(
        reference_from(layout),
        _texts(source),
        Path(output),
        Reading(**reading),
        None if rest is None else str(rest),
        mm_per_px,
        None if overlay is None else Path(overlay),
        None if quiver is None else Path(quiver),
    )
    return follow(job, watch)


def reconstruct(
    layout: LayoutLike | AnyLayout,
    rig: str | Path,
    rest: str | Path | int | Sequence[str | Path],
    source: str | Path | int | Sequence[str | Path | int],
    output: str | Path,
    *,
    watch: Callable[[Any], None] = lambda frame: None,
    shape: ShapeOptions | None = None,
    **reading: Unpack[ReadingOptions],
) -> Followed:
    """Reconstruct the surface in space from two or more views, as the command ``reconstruct`` does.

    >>> cmpdesign.reconstruct("layout.json", "rig.toml", "rest.png", "press.mp4", "run.npz")
    >>> cmpdesign.load_run("run.npz").arrays["position_mm"].shape      # (F, M, 3)

    Args:
        layout: see ``track``.
        rig: TOML file with [[view]] tables.
        rest: the pattern at rest: an image, or a frame's number in ``source``; for several sources a sequence.
        source: see ``open_source``; for several cameras a sequence with one for each view.
        output: see ``track``.
        watch: called with every ``extractor.ShapeFrame``.
        shape: options of the surface, see ``ShapeOptions``.
        reading: see ``ReadingOptions``.

    Raises:
        CmpDesignError, extractor.ExtractorError: an input that cannot be used; nothing is written.
        OutputError: a file cannot be written; the frames so far are complete.
    """
    job = ReconstructJob(
        reference_from(layout),
        Path(rig),
        _list_text(rest),
        _list_text(source),
        Path(output),
        Reading(**reading),
        shape or ShapeOptions(),
    )
    return follow(job, watch)


def open_source(
    source: AnySource, fps: float | None = None, max_pixels: int = MOST_PIXELS, times: str | None = None
) -> FrameSource:
    """Open a source of frames.

    >>> tracker = extractor.Tracker("layout.json")
    >>> for frame in cmpdesign.open_source("press.mp4").frames():
    ...     tracked = tracker.track(frame.image, time_s=frame.time_s, reason=frame.problem)

    Args:
        source: path of a picture, of a folder of pictures or of a video, a pattern such as "run*/*.png", a camera's
            number, a stream ("rtsp://..."), or a sequence of pictures, folders and patterns.
        fps: frames per second of a folder (default 30), or instead of a video's own rate.
        max_pixels: largest frame that is read, width x height.
        times: see ``ReadingOptions``.

    Raises:
        SourceError: the source cannot be opened.
    """
    from cmpdesign.tracking import sources

    return sources.open_source(_texts(source), fps, max_pixels, times)


def load_run(path: str | Path) -> Run:
    """Read an .npz file of ``track`` or ``reconstruct``.

    Raises:
        CmpDesignError: the file cannot be read, is no file of these commands, or holds no frame.
    """
    from cmpdesign.tracking.export.runs import read_run

    return read_run(Path(path))


@dataclass(frozen=True, eq=False)
class TrackJob:
    """The inputs of ``track``; ``overlay`` and ``quiver`` are files to draw, the other fields as for ``track``."""

    layout: Reference
    source: tuple[str, ...]
    output: Path
    reading: Reading
    rest: str | None = None
    mm_per_px: float | None = None
    overlay: Path | None = None
    quiver: Path | None = None

    def prepare(self) -> TrackingRun:
        """The run; all checks of the input are made here, before a file is written."""
        from cmpdesign.tracking.live.outputs import open_outputs
        from cmpdesign.tracking.overlay import OverlayWriter
        from cmpdesign.tracking.run import TrackingRun, read_rest_markers
        from cmpdesign.tracking.sources import DEFAULT_FPS, open_source
        from cmpdesign.tracking.summary import TrackStatistics
        from cmpdesign.tracking.table import TrackTable
        from extractor import Tracker

        _require_positive("mm_per_px", self.mm_per_px)
        if self.quiver is not None and self.quiver.suffix.lower() != ".png":
            raise CmpDesignError(f"{self.quiver}: unknown ending of a quiver plot; expected .png")
        how, source = self.reading, self.source
        new_tracker = partial(
            Tracker,
            self.layout,
            warm=not how.cold,
            preset=how.preset,
            response=how.response,
            side=how.side,
            channels=how.channels,
        )
        at_rest = None
        if self.rest is not None:
            at_rest = read_rest_markers(self.rest, source, how.fps, new_tracker(), how.max_pixels)
        tracker = new_tracker(rest=at_rest, mm_per_px=self.mm_per_px)
        frames = open_source(source, how.fps, how.max_pixels, how.times)
        video = None
        if self.overlay is not None:
            video = OverlayWriter(self.overlay, self.layout, frames.fps or DEFAULT_FPS)
        outputs = open_outputs(
            self.output, TrackTable(tracker, lambda: frames.times), how.recording, how.viewer
        )
        statistics = TrackStatistics(self.layout)
        return TrackingRun(frames, tracker, outputs.sink, statistics, video, how.frames, live=outputs.live)

    def summary(self, run: TrackingRun) -> dict[str, Any]:
        """The JSON object of the summary."""
        from cmpdesign.inputs.sources import without_password

        statistics, source = run.statistics, ", ".join(map(without_password, self.source))
        found: dict[str, Any] = statistics.to_json(
            source, run.source.total, run.ended_early, run.tracker.rest
        )
        return found

    def pictures(self, run: TrackingRun) -> dict[Path, bytes]:
        """The quiver plot, if a plot is wanted and a frame has a displacement."""
        farthest, rest = run.statistics.farthest, run.tracker.rest
        if self.quiver is None or farthest is None or rest is None:
            return {}
        from cmpdesign.files.images import to_png
        from cmpdesign.tracking.quiver import draw_quiver

        return {self.quiver: to_png(draw_quiver(self.layout, rest, farthest))}


@dataclass(frozen=True, eq=False)
class ReconstructJob:
    """The inputs of ``reconstruct``; ``rest`` and ``source`` are lists with commas for several cameras."""

    layout: Reference
    rig: Path
    rest: str
    source: str
    output: Path
    reading: Reading
    shape: ShapeOptions
    overlay: Path | None = None

    def prepare(self) -> TrackingRun:
        """The run; all checks of the input are made here, before a file is written."""
        from cmpdesign.tracking.live.outputs import open_outputs
        from cmpdesign.tracking.marker_depth import read_elastomer, read_marker_depth_mm
        from cmpdesign.tracking.run import TrackingRun
        from cmpdesign.tracking.shape_summary import ShapeStatistics
        from cmpdesign.tracking.shape_table import ShapeTable
        from cmpdesign.tracking.sources import open_sources, split_list
        from extractor import Reconstructor, ShapeTracker, ViewExtractor, load_rig

        how, shape = self.reading, self.shape
        rig, depth_mm = load_rig(self.rig), read_marker_depth_mm(self.rig)
        elastomer = read_elastomer(self.rig) if shape.surface else None
        if shape.from_rest:
            rig = rig.without_poses()
        views = ViewExtractor(self.layout, rig, "accurate", how.response, how.side, how.channels)
        at_rest = views.extract(self._rest_image())
        reconstructor = Reconstructor(
            views.layout,
            views.rig,
            at_rest,
            flatness_mm=(0.0, 0.0, shape.flatness_mm),
            model_px=shape.model_px,
        )
        continuation = None if elastomer is None else _continuation(elastomer, views.layout)
        contact = None if shape.contact is None else _contact_reader(shape.contact, self.rig, views.layout)
        source = open_sources(self.source, how.fps, how.max_pixels, how.times)
        is_one_a_view = len(split_list(self.source)) > 1
        recording = replace(how.recording, views=rig.views, is_image_one_a_view=is_one_a_view)
        outputs = open_outputs(
            self.output,
            ShapeTable(reconstructor, continuation, lambda: source.times, contact),
            recording,
            how.viewer,
        )
        tracker = ShapeTracker(
            reconstructor,
            warm=not how.cold,
            preset=how.preset,
            response=how.response,
            channels=how.channels,
        )
        statistics = ShapeStatistics(reconstructor, depth_mm, shape.surface)
        return TrackingRun(
            source,
            tracker,
            outputs.sink,
            statistics,
            limit=how.frames,
            warnings=reconstructor.warnings,
            live=outputs.live,
        )

    def summary(self, run: TrackingRun) -> dict[str, Any]:
        """The JSON object of the summary."""
        from cmpdesign.inputs.sources import without_password

        source = without_password(self.source)
        found: dict[str, Any] = run.statistics.to_json(source, run.source.total, run.ended_early)
        return found

    def pictures(self, run: TrackingRun) -> dict[Path, bytes]:
        """None."""
        return {}

    def _rest_image(self) -> Any:
        """The image at rest; of several sources a list with one image for each view."""
        from cmpdesign.tracking.run import read_rest_image
        from cmpdesign.tracking.sources import split_list

        sources, rests = split_list(self.source), split_list(self.rest)
        if len(rests) == 1:
            rests = rests * len(sources)
        if len(rests) != len(sources):
            raise CmpDesignError(
                f"REST lists {len(rests)} pictures, SOURCE {len(sources)}; give the same number of both"
            )
        images = [
            read_rest_image(rest, name, self.reading.fps, self.reading.max_pixels)
            for rest, name in zip(rests, sources, strict=True)
        ]
        return images if len(images) > 1 else images[0]


Job = TrackJob | ReconstructJob


def follow(job: Job, watch: Callable[[Any], None]) -> Followed:
    """Follow a source to its end and write the summary; after a failure the summary covers the frames so far.

    Raises:
        OutputError: a file cannot be written.
    """
    run = job.prepare()
    try:
        run.go(watch)
    except OutputError:
        with suppress(OutputError):
            write_summary(run, job)
        raise
    return write_summary(run, job)


def write_summary(run: TrackingRun, job: Job) -> Followed:
    """Write the summary beside the table of a run that has ended, and the quiver plot; no file if no frame was read.

    Raises:
        OutputError: a file cannot be written.
    """
    from cmpdesign.files.atomic import write_file

    if not run.statistics.frames:
        return Followed(job.output, (job.output,), {}, run.ended_early, run.warnings)
    summary = job.summary(run)
    summary["times"] = run.source.times.to_json()
    if run.live is not None:
        summary["live"] = {"address": run.live.address, **run.live.count()._asdict()}
    # Tables of several formats in one folder have a summary each.
    place = job.output.with_name(job.output.name + ".summary.json")
    contents: dict[Path, str | bytes] = {place: json.dumps(summary, indent=2, ensure_ascii=False) + "\n"}
    contents |= job.pictures(run)
    for path, content in contents.items():
        write_file(path, content)
    overlay = [] if job.overlay is None else [job.overlay]
    written = (job.output, *contents, *overlay)
    return Followed(job.output, written, summary, run.ended_early, run.warnings)


def _continuation(elastomer: Elastomer, layout: Reference) -> SurfaceContinuation:
    import numpy as np

    from cmpdesign.contact.continuation import SurfaceContinuation

    edges_mm = np.diff(layout.xy_mm[layout.edges], axis=1)[:, 0]
    return SurfaceContinuation(elastomer, layout.xy_mm, float(np.median(np.hypot(*edges_mm.T))))


def _contact_reader(gel: Path, rig: Path, layout: Reference) -> ContactReader:
    from cmpdesign.tracking.marker_depth import read_young_mpa
    from extractor.contact import ContactReader, load_gel

    young_mpa, sigma_mpa = read_young_mpa(rig)
    return ContactReader(layout, load_gel(gel), young_mpa, young_sigma_mpa=sigma_mpa)


def _require_positive(name: str, value: float | None) -> None:
    if value is not None and not 0 < value < float("inf"):
        raise CmpDesignError(f"{parameter(name)} is {value:g}; expected a number above 0")


def _texts(source: AnySource) -> tuple[str, ...]:
    """The texts of one source or of several, as the sources' functions take them."""
    return (str(source),) if isinstance(source, str | Path | int) else tuple(map(str, source))


def _list_text(value: str | Path | int | Sequence[str | Path | int]) -> str:
    """One name, or names with commas, as the sources' functions take them."""
    return str(value) if isinstance(value, str | Path | int) else ",".join(map(str, value))
