"""Sequences followed into files: ``track`` and ``reconstruct`` of the command line, and their files read back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Unpack

from cmpdesign import documents
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.inputs.options import Written, settled
from cmpdesign.tracking.jobs.options import ShapeOptions, TrackOptions

if TYPE_CHECKING:
    from cmpdesign.api.layouts import AnyLayout
    from cmpdesign.inputs.cameras import CameraSettings
    from cmpdesign.tracking.jobs.job import ReconstructJob, TrackJob
    from cmpdesign.tracking.sources import FrameSource

AnySource = str | Path | int | Sequence[str | Path]


def track(
    layout: AnyLayout,
    source: AnySource,
    output: str | Path,
    *,
    on_frame: Callable[[Any], None] = lambda frame: None,
    **options: Unpack[TrackOptions],
) -> documents.runs.TrackDocument:
    """Follow a pattern through a video, a folder or a camera into a table, as the command ``track`` does.

    >>> summary = cmpdesign.track("layout.json", "press.mp4", "run.npz", rest=0)
    >>> run = cmpdesign.load_run("run.npz")
    >>> run.arrays["displacement_mm"].shape               # (F, M, 2)

    For markers frame by frame without a file, use ``cmpdesign.open_source`` and ``extractor.Tracker``.

    Args:
        layout: the pattern's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        source: pictures, folders, patterns such as "run*/*.png", a video, a camera's number, or rtsp://...; or what
            ``open_source`` takes.
        output: table (.npz, .parquet, .csv), or recording (.mcap, .rrd; without ending a rosbag2 folder).
        on_frame: called with every ``extractor.Tracked``.
        options: see ``TrackOptions``.

    Raises:
        CmpDesignError: a source, an image at rest or an option that cannot be used; nothing is written.
        OutputError: a file cannot be written; the frames so far are complete.
    """
    from cmpdesign.tracking.jobs.job import follow

    return follow(track_job(layout, source, output, **options), on_frame)


def reconstruct(
    layout: AnyLayout,
    rig: str | Path,
    rest: Annotated[str | Path | int | Sequence[str | Path], Written(with_commas=True)],
    source: Annotated[str | Path | int | Sequence[str | Path | int], Written(with_commas=True)],
    output: str | Path,
    *,
    on_frame: Callable[[Any], None] = lambda frame: None,
    **options: Unpack[ShapeOptions],
) -> documents.runs.ReconstructDocument:
    """Reconstruct the surface in space from two or more views, as the command ``reconstruct`` does.

    >>> cmpdesign.reconstruct("layout.json", "rig.toml", "rest.png", "press.mp4", "run.npz")
    >>> cmpdesign.load_run("run.npz").arrays["position_mm"].shape      # (F, M, 3)

    Args:
        layout: see ``track``.
        rig: the views: a TOML file with [[view]] tables.
        rest: the pattern at rest: an image, or a frame's number in ``source``; or for several sources a sequence.
        source: a folder of pictures, a pattern such as "run/*.png", a video, a camera's number, or rtsp://...; one for
            each view, with commas; or a sequence with one for each view.
        output: table (.npz, .parquet, .csv), or recording (.mcap, .rrd; without ending a rosbag2 folder).
        on_frame: called with every ``extractor.ShapeFrame``.
        options: see ``ShapeOptions``.

    Raises:
        CmpDesignError, extractor.ExtractorError: an input that cannot be used; nothing is written.
        OutputError: a file cannot be written; the frames so far are complete.
    """
    from cmpdesign.tracking.jobs.job import follow

    return follow(reconstruct_job(layout, rig, rest, source, output, **options), on_frame)


def recover_run(
    layout: AnyLayout, output: str | Path, of: Literal["track", "reconstruct"] = "track"
) -> documents.runs.RecoverDocument:
    """Complete the table or recording of a run that was killed, as the commands' ``--recover`` does.

    Args:
        layout: see ``track``.
        output: the file of the run.
        of: the call that was killed.

    Raises:
        CmpDesignError: there is nothing to recover.
        OutputError: the file cannot be written.
    """
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.tracking.sinks.tables import recover_table

    pattern = reference_from(layout)
    rows = len(pattern.layer)
    if of == "reconstruct":
        rows += len(pattern.edges) * pattern.virtual_per_edge
    found = recover_table(Path(output), rows)
    return documents.runs.RecoverDocument.of(found, written=str(output) if found.frames else None)


def track_job(
    layout: AnyLayout, source: AnySource, output: str | Path, **options: Unpack[TrackOptions]
) -> TrackJob:
    """The work of ``track``, with all options."""
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.tracking.jobs.job import TrackJob

    chosen = settled(TrackOptions, options)
    return TrackJob(reference_from(layout), _texts(source), Path(output), chosen)


def reconstruct_job(
    layout: AnyLayout,
    rig: str | Path,
    rest: str | Path | int | Sequence[str | Path],
    source: str | Path | int | Sequence[str | Path | int],
    output: str | Path,
    **options: Unpack[ShapeOptions],
) -> ReconstructJob:
    """The work of ``reconstruct``, with all options."""
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.tracking.jobs.job import ReconstructJob

    chosen = settled(ShapeOptions, options)
    pattern = reference_from(layout)
    return ReconstructJob(
        pattern, Path(rig), ",".join(_texts(rest)), ",".join(_texts(source)), Path(output), chosen
    )


def open_source(
    source: AnySource,
    fps: float | None = None,
    max_pixels: int = MAX_PIXELS,
    times: str | None = None,
    bits: int | None = None,
    camera: CameraSettings | None = None,
) -> FrameSource:
    """Open a source of frames.

    >>> tracker = extractor.Tracker("layout.json")
    >>> for frame in cmpdesign.open_source("press.mp4").frames():
    ...     tracked = tracker.track(frame.image, time_s=frame.time_s, reason=frame.problem)

    Args:
        source: path of a picture, of a folder of pictures or of a video, a pattern such as "run*/*.png", a camera's
            number, file, serial number or a part of its name, a stream ("rtsp://..."), or a sequence of pictures,
            folders and patterns.
        fps: frames per second of a folder (default 30), or instead of a video's own rate.
        max_pixels: largest frame that is read, width x height.
        times: see ``SequenceOptions``.
        bits: see ``SequenceOptions``.
        camera: settings that are asked of a camera; ``source.camera`` has the driver's answer.

    Raises:
        SourceError: the source cannot be opened.
    """
    from cmpdesign.tracking import sources

    how = sources.Reading(fps, max_pixels, times, bits)
    how = how if camera is None else replace(how, camera=camera)
    return sources.open_source(_texts(source), how)


def cameras() -> documents.runs.CamerasDocument:
    """List the cameras: formats, sizes and rates, and the ranges of exposure, gain, white balance and focus.

    >>> [camera.name for camera in cmpdesign.cameras().cameras]

    Raises:
        SourceError: this system has no V4L2 (Linux).
    """
    from dataclasses import asdict

    from cmpdesign.inputs.cameras import list_cameras

    found = [asdict(camera) for camera in list_cameras()]
    return documents.runs.CamerasDocument(
        cameras=tuple(documents.runs.ListedCameraPart(**(camera.pop("offer") | camera)) for camera in found)
    )


def _texts(source: str | Path | int | Sequence[str | Path | int]) -> tuple[str, ...]:
    """The texts of one source or of several, as the sources' functions take them."""
    return (str(source),) if isinstance(source, str | Path | int) else tuple(map(str, source))
