"""The work of ``track`` and ``reconstruct``: a source followed to its end, its files and its summary."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar

from cmpdesign.documents.document import Document
from cmpdesign.documents.runs import ReconstructDocument, TrackDocument
from cmpdesign.errors import CmpDesignError, OutputError, parameter
from cmpdesign.inputs.options import pixels_of
from cmpdesign.inputs.texts import visible
from cmpdesign.tracking.jobs.force_readers import contact_reader, contact_tracker
from cmpdesign.tracking.jobs.options import SequenceOptions, ShapeOptions, TrackOptions
from cmpdesign.tracking.live.options import Live
from cmpdesign.tracking.recording.options import Recording
from cmpdesign.watch import notice, warn

if TYPE_CHECKING:
    from cmpdesign.contact.continuation import SurfaceContinuation
    from cmpdesign.contact.elastomer import Elastomer
    from cmpdesign.tracking.live.view import LiveCount
    from cmpdesign.tracking.run import TrackingRun
    from cmpdesign.tracking.sources import Reading
    from extractor import ContactTracker, Reference, Tracker

Summary = TypeVar("Summary", bound=Document, covariant=True)


class Job(Protocol[Summary]):
    """A sequence to follow: the run is prepared, and its end is summed up in a document."""

    @property
    def document(self) -> type[Summary]: ...

    @property
    def output(self) -> Path: ...

    @property
    def overlay(self) -> Path | None: ...

    def prepare(self) -> TrackingRun: ...

    def summary(self, run: TrackingRun) -> dict[str, Any]: ...

    def pictures(self, run: TrackingRun) -> dict[Path, bytes]: ...


def reading_of(options: SequenceOptions) -> Reading:
    """How the source is read.

    Raises:
        SourceError: a camera's size or format that cannot be.
    """
    from cmpdesign.inputs.cameras import CameraSettings
    from cmpdesign.tracking.sources import Reading

    size = options["camera_size"]
    camera = CameraSettings(
        None if size is None else pixels_of("camera_size", size),
        options["camera_fps"],
        options["camera_format"],
        options["exposure_ms"],
        options["gain"],
        options["white_balance_k"],
        options["focus"],
    )
    return Reading(options["fps"], options["max_pixels"], options["times"], options["bits"], camera)


def recording_of(options: SequenceOptions) -> Recording:
    """The options of a recording.

    Raises:
        CmpDesignError: a frame id that no topic can have.
    """
    return Recording(options["frame_id"], options["with_images"])


def viewer_of(options: SequenceOptions) -> Live | None:
    """The live server's options, if a server is wanted.

    Raises:
        CmpDesignError: a server that cannot be, or options of a server without one.
    """
    kind, port, wait_s = options["live"], options["live_port"], options["live_wait_s"]
    if kind is not None:
        return Live(kind, port, wait_s)
    if port is not None or wait_s:
        names = f"{parameter('live_port')} and {parameter('live_wait_s')}"
        raise CmpDesignError(f"{names} need {parameter('live')}")
    return None


@dataclass(frozen=True, eq=False)
class TrackJob:
    """The inputs of ``track``, with all options."""

    document: ClassVar = TrackDocument
    layout: Reference
    source: tuple[str, ...]
    output: Path
    options: TrackOptions

    @property
    def overlay(self) -> Path | None:
        """The video to draw, if any."""
        return _path(self.options["overlay"])

    def prepare(self) -> TrackingRun:
        """The run; all checks of the input are made here, before a file is written."""
        from cmpdesign.tracking.live.outputs import open_outputs
        from cmpdesign.tracking.overlay import OverlayWriter
        from cmpdesign.tracking.run import TrackingRun, read_rest_markers
        from cmpdesign.tracking.sources import DEFAULT_FPS, open_source
        from cmpdesign.tracking.summary import TrackStatistics
        from cmpdesign.tracking.table import TrackTable
        from extractor import Tracker

        how, source, reading = self.options, self.source, reading_of(self.options)
        quiver, viewer = _path(how["quiver"]), viewer_of(how)
        if quiver is not None and quiver.suffix.lower() != ".png":
            raise CmpDesignError(f"{parameter('quiver')} {quiver}: unknown ending; expected .png")
        new_tracker = partial(
            Tracker,
            self.layout,
            warm=not how["cold"],
            preset=how["preset"],
            response=how["response"],
            side=how["side"],
            channels=how["channels"],
        )
        at_rest, rest = None, how["rest"]
        if rest is not None:
            at_rest = read_rest_markers(str(rest), source, reading, new_tracker())
        plain = new_tracker(rest=at_rest, mm_per_px=how["mm_per_px"])
        tracker: Tracker | ContactTracker = plain
        contact, gel, rig = None, _path(how["contact"]), _path(how["rig"])
        if (gel is None) != (rig is None):
            raise CmpDesignError(f"{parameter('contact')} and {parameter('rig')} need each other; give both")
        if gel is not None and rig is not None:
            contact = contact_reader(gel, rig, self.layout)
            tracker = contact_tracker(plain, rig, contact, at_rest)
        frames = open_source(source, reading)
        video = None
        if self.overlay is not None:
            video = OverlayWriter(self.overlay, self.layout, frames.fps or DEFAULT_FPS)
        outputs = open_outputs(
            self.output, TrackTable(tracker, lambda: frames.times, contact), recording_of(how), viewer
        )
        statistics = TrackStatistics(self.layout)
        return TrackingRun(frames, tracker, outputs.sink, statistics, video, how["frames"], live=outputs.live)

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
        quiver = _path(self.options["quiver"])
        if quiver is None or farthest is None or rest is None:
            return {}
        from cmpdesign.files.images import to_png
        from cmpdesign.tracking.quiver import draw_quiver

        return {quiver: to_png(draw_quiver(self.layout, rest, farthest))}


@dataclass(frozen=True, eq=False)
class ReconstructJob:
    """The inputs of ``reconstruct``, with all options; ``rest`` and ``source`` are lists with commas for several
    cameras.
    """

    document: ClassVar = ReconstructDocument
    layout: Reference
    rig: Path
    rest: str
    source: str
    output: Path
    options: ShapeOptions
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

        how, viewer = self.options, viewer_of(self.options)
        rig, depth_mm = load_rig(self.rig), read_marker_depth_mm(self.rig)
        elastomer = read_elastomer(self.rig) if how["surface"] else None
        if how["from_rest"]:
            rig = rig.without_poses()
        views = ViewExtractor(self.layout, rig, "accurate", how["response"], how["side"], how["channels"])
        at_rest = views.extract(self._rest_image())
        reconstructor = Reconstructor(
            views.layout,
            views.rig,
            at_rest,
            flatness_mm=(0.0, 0.0, how["flatness_mm"]),
            model_px=how["model_px"],
        )
        continuation = None if elastomer is None else _continuation(elastomer, views.layout)
        gel = _path(how["contact"])
        contact = None if gel is None else contact_reader(gel, self.rig, views.layout)
        source = open_sources(self.source, reading_of(how))
        is_one_a_view = len(split_list(self.source)) > 1
        recording = replace(recording_of(how), views=rig.views, is_image_one_a_view=is_one_a_view)
        outputs = open_outputs(
            self.output,
            ShapeTable(reconstructor, continuation, lambda: source.times, contact),
            recording,
            viewer,
        )
        tracker = ShapeTracker(
            reconstructor,
            warm=not how["cold"],
            preset=how["preset"],
            response=how["response"],
            channels=how["channels"],
            contact=contact,
        )
        statistics = ShapeStatistics(reconstructor, depth_mm, how["surface"])
        return TrackingRun(
            source,
            tracker,
            outputs.sink,
            statistics,
            limit=how["frames"],
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
                f"{parameter('rest')} lists {len(rests)} pictures, {parameter('source')} {len(sources)}; "
                "give the same number of both"
            )
        images = [
            read_rest_image(rest, name, reading_of(self.options))
            for rest, name in zip(rests, sources, strict=True)
        ]
        return images if len(images) > 1 else images[0]


def follow(job: Job[Summary], on_frame: Callable[[Any], None]) -> Summary:
    """Follow a source to its end and write the summary; after a failure the summary covers the frames so far.

    Raises:
        OutputError: a file cannot be written.
        KeyboardInterrupt: stopped before the first frame.
    """
    run = job.prepare()
    _give_notice(run)
    said = len(run.source.notes)
    try:
        run.go(on_frame)
    except OutputError:
        with suppress(OutputError, CmpDesignError):
            write_summary(run, job)
        raise
    finally:
        if run.live is not None:
            _warn_of_losses(run.live.count())
    if run.stop.is_requested and not run.statistics.frames:
        raise KeyboardInterrupt
    for note in run.source.notes[said:]:
        warn(note)
    return write_summary(run, job)


def _give_notice(run: TrackingRun) -> None:
    """Report what is known before the first frame; the times of a live source are known at its end."""
    source = run.source
    for warning in (*run.warnings, *source.notes):
        warn(warning)
    times = f"{visible(source.name)}: {source.times.text}"
    if source.times.is_doubtful:
        warn(times)
    elif not source.is_live:
        notice(times)
    if run.live is not None:
        notice(f"live at {run.live.address}")


def _warn_of_losses(count: LiveCount) -> None:
    """Report the frames that viewers did not receive."""
    if count.failure:
        warn(f"the live server stopped after {count.sent} frames ({count.failure})")
    if count.left_out:
        total = count.sent + count.left_out
        warn(f"{count.left_out} of {total} frames were not shown live: there was no time to send them")
    if count.is_viewer_behind:
        warn(
            "a live viewer read more slowly than the frames were made; some frames were not sent to the viewer"
        )


def write_summary(run: TrackingRun, job: Job[Summary]) -> Summary:
    """Write the summary beside the table of a run that has ended, and the quiver plot.

    Raises:
        CmpDesignError: no frame was read; no summary is written.
        OutputError: a file cannot be written.
    """
    from cmpdesign.files.atomic import write_file

    if not run.statistics.frames:
        raise CmpDesignError(f"{run.source.name}: no frame could be read")
    summary = job.summary(run)
    summary["times"] = run.source.times.to_json()
    summary["notes"] = list(run.source.notes)
    summary["cameras"] = [state.to_json() for state in run.source.camera]
    if run.live is not None:
        summary["live"] = {"address": run.live.address, **run.live.count()._asdict()}
    # Tables of several formats in one folder have a summary each.
    place = job.output.with_name(job.output.name + ".summary.json")
    document = job.document.of(run, **summary)  # its schema is that of the file
    contents: dict[Path, str | bytes] = {place: json.dumps(summary, indent=2, ensure_ascii=False) + "\n"}
    contents |= job.pictures(run)
    for path, content in contents.items():
        write_file(path, content)
    written = (job.output, *contents, *([] if job.overlay is None else [job.overlay]))
    return document.model_copy(update={"written": tuple(visible(str(path)) for path in written)})


def _continuation(elastomer: Elastomer, layout: Reference) -> SurfaceContinuation:
    import numpy as np

    from cmpdesign.contact.continuation import SurfaceContinuation

    edges_mm = np.diff(layout.xy_mm[layout.edges], axis=1)[:, 0]
    return SurfaceContinuation(elastomer, layout.xy_mm, float(np.median(np.hypot(*edges_mm.T))))


def _path(given: str | Path | None) -> Path | None:
    return None if given is None else Path(given)
