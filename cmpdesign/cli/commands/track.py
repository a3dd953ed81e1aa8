"""``cmpdesign track``: tracks a pattern through a video, a folder of images or the frames of a camera."""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from cmpdesign.cli.options.images import (
    ChannelsOption,
    FramesOption,
    MaxPixelsOption,
    PresetOption,
    SideOption,
    SourcesArgument,
)
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.options.recording import OUTPUT_HELP, FrameIdOption, WithImagesOption
from cmpdesign.cli.options.response import METAVAR, READING_HELP, parse_reading_response
from cmpdesign.cli.run_progress import (
    exit_status,
    print_written,
    recover_and_report,
    require_positive,
    run_with_progress,
    summary_path,
)
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.errors import OutputError
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.inputs.sources import without_password

if TYPE_CHECKING:
    from cmpdesign.tracking.recording.options import Recording
    from cmpdesign.tracking.run import TrackingRun
    from extractor.image.input import Channels
    from extractor.image.response import Response
    from extractor.layout.reference import Reference
    from extractor.pipeline import Side
    from extractor.presets import Preset

EXAMPLES = (
    "cmpdesign track layout.json frames -o run.npz",
    "cmpdesign track layout.json press.mp4 -o run.csv --overlay found.mp4 --frames 100",
)


def track(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
    source: SourcesArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help=OUTPUT_HELP)],
    rest: Annotated[
        str | None,
        typer.Option(
            metavar="N|IMAGE", help="What displacement is counted from. [default: the first tracked frame]"
        ),
    ] = None,
    mm_per_px: Annotated[
        float | None,
        typer.Option(
            metavar="SCALE", help="Scale for mm along the image's axes. [default: mm in the layout's frame]"
        ),
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second. [default: a video's own; 30 for a folder]")
    ] = None,
    frames: FramesOption = None,
    overlay: Annotated[
        Path | None, typer.Option(metavar="VIDEO", help="Video of what was found: .mp4, .avi or .mkv.")
    ] = None,
    quiver: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Arrows of the frame with the largest displacement.")
    ] = None,
    cold: Annotated[bool, typer.Option("--cold", help="Never start from the frame before: slower.")] = False,
    preset: PresetOption = "balanced",
    response: Annotated[str | None, typer.Option(metavar=METAVAR, help=READING_HELP)] = None,
    side: SideOption = "designed",
    channels: ChannelsOption = "bgr",
    max_pixels: MaxPixelsOption = MOST_PIXELS,
    frame_id: FrameIdOption = "tactile",
    with_images: WithImagesOption = False,
    recover: Annotated[
        bool, typer.Option("--recover", help="Only complete the FILE that a killed run left in pieces.")
    ] = False,
) -> None:
    """Follow a pattern; exit code 0 done, 1 ended early or nothing tracked, 2 bad input or full disk."""
    from cmpdesign.cli.documents.runs import TrackDocument

    if recover:
        from extractor import load_layout

        recover_and_report(output, len(load_layout(layout).layer))
        return
    from cmpdesign.tracking.recording.options import Recording

    recording = Recording(frame_id, with_images)
    require_positive("--mm-per-px", mm_per_px)
    require_positive("--fps", fps)
    require_suffix("--quiver", quiver, [".png"])
    from extractor import load_layout

    reference = load_layout(layout)
    reading = _Reading(not cold, preset, parse_reading_response(response), side, channels)
    run = _prepare_run(
        reference, _Options(source, output, rest, mm_per_px, fps, overlay, reading, max_pixels, recording)
    )
    run.limit = frames
    try:
        run_with_progress(run, "tracking")
    except OutputError:  # the summary covers the frames so far
        with suppress(OutputError):
            print_written(_write_summary(run, reference, source, output, quiver).written)
        raise
    summary = _write_summary(run, reference, source, output, quiver)
    written = [output, *summary.written, *([overlay] if overlay is not None and summary.written else [])]
    print_written(written)
    code = exit_status(run)
    finish(lambda: TrackDocument(**summary.document, written=tuple(map(printable_path, written))), code)


class _Reading(NamedTuple):
    """Options of the ``Tracker``."""

    warm: bool
    preset: Preset
    response: Response | None
    side: Side
    channels: Channels


class _Options(NamedTuple):
    """Arguments and options of the command."""

    source: list[str]
    output: Path
    rest: str | None
    mm_per_px: float | None
    fps: float | None
    overlay: Path | None
    reading: _Reading
    max_pixels: int
    recording: Recording


def _prepare_run(reference: Reference, options: _Options) -> TrackingRun:
    """Prepare the run; all checks of the input are made here, before a file is written."""
    from cmpdesign.tracking.overlay import OverlayWriter
    from cmpdesign.tracking.run import TrackingRun, read_rest_markers
    from cmpdesign.tracking.sinks.tables import open_sink
    from cmpdesign.tracking.sources import DEFAULT_FPS, open_source
    from cmpdesign.tracking.summary import TrackStatistics
    from cmpdesign.tracking.table import TrackTable
    from extractor.track.tracker import Tracker

    rest, source, fps, most_pixels = options.rest, options.source, options.fps, options.max_pixels
    new_tracker = partial(Tracker, reference, **options.reading._asdict())
    at_rest = None if rest is None else read_rest_markers(rest, source, fps, new_tracker(), most_pixels)
    tracker = new_tracker(rest=at_rest, mm_per_px=options.mm_per_px)
    frames = open_source(source, fps, most_pixels)
    print_step(f"{frames.name}: {'unknown number of' if frames.total is None else frames.total} frames")
    path = options.overlay
    video = None if path is None else OverlayWriter(path, reference, frames.fps or DEFAULT_FPS)
    sink = open_sink(options.output, TrackTable(tracker), options.recording)
    return TrackingRun(frames, tracker, sink, TrackStatistics(reference), video)


class _Summary(NamedTuple):
    """The summary of a run, and the files that were written with it; empty without frames."""

    document: dict[str, Any]
    written: list[Path]


def _write_summary(
    run: TrackingRun, reference: Reference, source: list[str], output: Path, quiver: Path | None
) -> _Summary:
    """Write the summary next to the table and the quiver plot, and print the summary."""
    if not run.statistics.frames:
        return _Summary({}, [])
    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import to_png
    from cmpdesign.tracking.quiver import draw_quiver

    names = ", ".join(map(without_password, source))
    summary = run.statistics.to_json(names, run.source.total, run.ended_early, run.tracker.rest)
    _print_summary(summary)
    text = json.dumps(summary, indent=2, ensure_ascii=False) + "\n"
    contents: dict[Path, str | bytes] = {summary_path(output): text}
    farthest, rest = run.statistics.farthest, run.tracker.rest
    if quiver is not None and farthest is not None and rest is not None:
        contents[quiver] = to_png(draw_quiver(reference, rest, farthest))
    elif quiver is not None:
        print_warning(f"{printable_path(quiver)} is not drawn: no frame has a displacement")
    for path, content in contents.items():
        write_file(path, content)
    return _Summary(summary, list(contents))


def _print_summary(summary: dict[str, Any]) -> None:
    from rich.table import Table

    from cmpdesign.reading.quality import quality_text, reasons_text

    frames, shares, rate = summary["frames"], summary["marker_shares"], summary["frames_per_s"]
    times = ", ".join(f"{name} {value:.1f} ms" for name, value in summary["time_ms"].items())
    others = {name: frames[name] for name in ("lost", "unreadable", "other_size") if frames[name]}
    not_tracked = "".join(f", {count} {name.replace('_', ' ')}" for name, count in others.items())
    jitter, largest = summary["jitter_px"], summary["largest_displacement"]
    rows = {
        "frames": f"{frames['read']} read, {frames['tracked']} tracked{not_tracked}",
        "starts": ", ".join(f"{count} {start}" for start, count in summary["starts"].items()) or "none",
        "markers": ", ".join(f"{share:.2%} {name}" for name, share in shares.items()),
        "time a frame": times + (f"; on the whole {rate:.3g} frames per second" if rate else ""),
        "jitter at rest": "too few resting frames" if jitter is None else f"{jitter:.4f} px per axis",
    }
    if summary["reasons"]:
        rows["not tracked, or in part"] = reasons_text(summary["reasons"])
    if summary["quality"] is not None:
        rows["image quality"] = quality_text(summary["quality"])
        if summary["quality"]["hints"]:
            rows["what to do"] = "; ".join(summary["quality"]["hints"])
    if largest is not None:
        mm = "" if largest["mm"] is None else f" = {largest['mm']:.4g} mm"
        rows["largest displacement"] = (
            f"{largest['px']:.3f} px{mm}, marker {largest['marker']} in frame {largest['frame']}"
        )
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    say(table)
