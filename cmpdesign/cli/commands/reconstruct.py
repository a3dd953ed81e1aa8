"""``cmpdesign reconstruct``: reconstructs the surface in space from two or more views, through a sequence."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from cmpdesign.cli.options.images import (
    ChannelsOption,
    FramesOption,
    MaxPixelsOption,
    PresetOption,
    SideOption,
)
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
from cmpdesign.cli.terminal import finish, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.inputs.files import MOST_PIXELS
from cmpdesign.inputs.sources import without_password

if TYPE_CHECKING:
    from cmpdesign.contact.continuation import SurfaceContinuation
    from cmpdesign.contact.elastomer import Elastomer
    from cmpdesign.tracking.recording.options import Recording
    from cmpdesign.tracking.run import TrackingRun
    from extractor.image.input import Channels
    from extractor.image.response import Response
    from extractor.layout.reference import Reference
    from extractor.pipeline import Side
    from extractor.presets import Preset

EXAMPLES = (
    "cmpdesign reconstruct layout.json rig.toml rest.png frames -o run.npz",
    "cmpdesign reconstruct layout.json rig.toml 0 press.avi -o run.csv --frames 100",
)


def reconstruct(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
    rig: Annotated[Path, typer.Argument(metavar="RIG", help="The views: a TOML file with [[view]] tables.")],
    rest: Annotated[
        str,
        typer.Argument(metavar="REST", help="The pattern at rest: an image, or a frame's number in SOURCE."),
    ],
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help='A folder of pictures, a pattern such as "run/*.png", a video, a camera\'s number, or rtsp://...; '
            "one for each view, with commas.",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help=OUTPUT_HELP)],
    from_rest: Annotated[
        bool, typer.Option("--from-rest", help="Place all views by REST, also those whose pose RIG gives.")
    ] = False,
    flatness_mm: Annotated[
        float, typer.Option(metavar="MM", help="How far the markers may lie off the plane at rest.")
    ] = 0.0,
    model_px: Annotated[
        float | None,
        typer.Option(
            metavar="PX", help="What the camera model leaves open. [default: as the rest frame says]"
        ),
    ] = None,
    surface: Annotated[
        bool,
        typer.Option(
            "--surface",
            help="Also give the touched surface, by the [elastomer] of RIG, in columns of its own.",
        ),
    ] = False,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second. [default: a video's own; 30 for a folder]")
    ] = None,
    frames: FramesOption = None,
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
    """Positions, displacements and normals in mm; exit code 0 done, 1 ended early or nothing found, 2 bad input."""
    from cmpdesign.cli.documents.runs import ReconstructDocument

    if recover:
        from extractor import load_layout

        recover_and_report(output, _points_in(load_layout(layout)))
        return
    from cmpdesign.tracking.recording.options import Recording

    recording = Recording(frame_id, with_images)
    require_positive("--fps", fps)
    for option, value in (("--flatness-mm", flatness_mm), ("--model-px", model_px)):
        if value is not None and not 0 <= value < float("inf"):
            raise CmpDesignError(f"{option} is {value:g}; expected a number from 0")
    known = parse_reading_response(response)
    options = _Options(
        layout,
        rig,
        rest,
        source,
        output,
        from_rest,
        flatness_mm,
        model_px,
        surface,
        fps,
        cold,
        preset,
        known,
        side,
        channels,
        max_pixels,
        recording,
    )
    run = _prepare_run(options)
    run.limit = frames
    try:
        run_with_progress(run, "reconstructing")
    except OutputError:  # the summary covers the frames so far
        with suppress(OutputError):
            print_written(_write_summary(run, source, output).written)
        raise
    summary = _write_summary(run, source, output)
    written = [output, *summary.written]
    print_written(written)
    code = exit_status(run)
    finish(lambda: ReconstructDocument(**summary.document, written=tuple(map(printable_path, written))), code)


class _Options(NamedTuple):
    """Arguments and options of the command."""

    layout: Path
    rig: Path
    rest: str
    source: str
    output: Path
    from_rest: bool
    flatness_mm: float
    model_px: float | None
    surface: bool
    fps: float | None
    cold: bool
    preset: Preset
    response: Response | None
    side: Side
    channels: Channels
    max_pixels: int
    recording: Recording


def _points_in(layout: Reference) -> int:
    """The number of points of a frame: markers and virtual markers."""
    return len(layout.layer) + len(layout.edges) * layout.virtual_per_edge


def _prepare_run(options: _Options) -> TrackingRun:
    """Prepare the run; all checks of the input are made here, before a file is written."""
    from cmpdesign.tracking.marker_depth import read_elastomer, read_marker_depth_mm
    from cmpdesign.tracking.run import TrackingRun
    from cmpdesign.tracking.shape_summary import ShapeStatistics
    from cmpdesign.tracking.shape_table import ShapeTable
    from cmpdesign.tracking.sinks.tables import open_sink
    from cmpdesign.tracking.sources import open_sources
    from extractor import Reconstructor, ShapeTracker, ViewExtractor, load_layout, load_rig

    rig, depth_mm = load_rig(options.rig), read_marker_depth_mm(options.rig)
    elastomer = read_elastomer(options.rig) if options.surface else None
    if options.from_rest:
        rig = rig.without_poses()
    how = options.response, options.side, options.channels
    views = ViewExtractor(load_layout(options.layout), rig, "accurate", *how)
    at_rest = views.extract(_read_rest_image(options))
    flatness_mm = (0.0, 0.0, options.flatness_mm)
    reconstructor = Reconstructor(
        views.layout, views.rig, at_rest, flatness_mm=flatness_mm, model_px=options.model_px
    )
    for warning in reconstructor.warnings:
        print_warning(warning)
    continuation = None if elastomer is None else _continuation(elastomer, views.layout)
    recording = replace(options.recording, views=rig.views)
    sink = open_sink(options.output, ShapeTable(reconstructor, continuation), recording)
    tracker = ShapeTracker(
        reconstructor,
        warm=not options.cold,
        preset=options.preset,
        response=options.response,
        channels=options.channels,
    )
    source = open_sources(options.source, options.fps, options.max_pixels)
    return TrackingRun(source, tracker, sink, ShapeStatistics(reconstructor, depth_mm, options.surface))


def _continuation(elastomer: Elastomer, layout: Reference) -> SurfaceContinuation:
    import numpy as np

    from cmpdesign.contact.continuation import SurfaceContinuation

    edges_mm = np.diff(layout.xy_mm[layout.edges], axis=1)[:, 0]
    return SurfaceContinuation(elastomer, layout.xy_mm, float(np.median(np.hypot(*edges_mm.T))))


def _read_rest_image(options: _Options) -> Any:
    """The image at rest; of several sources a list with one image for each view."""
    from cmpdesign.tracking.run import read_rest_image
    from cmpdesign.tracking.sources import split_list

    sources, rests = split_list(options.source), split_list(options.rest)
    if len(rests) == 1:
        rests = rests * len(sources)
    if len(rests) != len(sources):
        raise CmpDesignError(f"REST lists {len(rests)} pictures, SOURCE {len(sources)}; give as many of both")
    images = [
        read_rest_image(rest, name, options.fps, options.max_pixels)
        for rest, name in zip(rests, sources, strict=True)
    ]
    return images if len(images) > 1 else images[0]


class _Summary(NamedTuple):
    """The summary of a run, and the files that were written with it; empty without frames."""

    document: dict[str, Any]
    written: list[Path]


def _write_summary(run: TrackingRun, source: str, output: Path) -> _Summary:
    """Write the summary next to the table and print it."""
    if not run.statistics.frames:
        return _Summary({}, [])
    from cmpdesign.files.atomic import write_file

    summary = run.statistics.to_json(without_password(source), run.source.total, run.ended_early)
    _print_summary(summary)
    text = json.dumps(summary, indent=2, ensure_ascii=False) + "\n"
    write_file(summary_path(output), text)
    return _Summary(summary, [summary_path(output)])


def _describe_positions(depth_mm: float | None, is_continued: bool) -> str:
    """Of what the positions are: what the cameras see is the pattern, wherever it lies."""
    if is_continued:
        return f"of the pattern, {depth_mm:g} mm below the touched surface; surface_* of that surface"
    if depth_mm is None:
        return "of the pattern; RIG does not say how far below the touched surface it lies"
    if depth_mm == 0:
        return "of the pattern, which RIG puts on the touched surface"
    return f"of the pattern, {depth_mm:g} mm below the touched surface; not of that surface"


def _print_summary(summary: dict[str, Any]) -> None:
    from rich.table import Table

    frames, sigma, largest = summary["frames"], summary["sigma_um"], summary["largest_displacement"]
    others = {name: frames[name] for name in ("lost", "unreadable", "other_size") if frames[name]}
    not_tracked = "".join(f", {count} {name.replace('_', ' ')}" for name, count in others.items())
    rows = {
        "frames": f"{frames['read']} read, {frames['tracked']} tracked{not_tracked}",
        "views": "; ".join(f"{view['name']} {view['rms_px']:.3f} px at rest" for view in summary["views"]),
        "markers": ", ".join(f"{share:.2%} {name}" for name, share in summary["marker_shares"].items()),
    }
    rows["positions"] = _describe_positions(
        summary["positions"]["depth_mm"], summary["positions"]["continued_to_surface"]
    )
    if summary["lost_markers"]:
        lost = summary["lost_markers"].items()
        rows["not reported"] = ", ".join(f"{count} x {reason.replace('_', ' ')}" for reason, count in lost)
    if summary["reasons"]:
        rows["notes"] = ", ".join(f"{count} x {reason}" for reason, count in summary["reasons"].items())
    if sigma is not None:
        rows["standard deviation"] = ", ".join(
            f"{axis} {value:.2f} um" for axis, value in zip("xyz", sigma, strict=True)
        )
    if largest is not None:
        rows["largest displacement"] = (
            f"{largest['mm']:.4f} mm, marker {largest['marker']} in frame {largest['frame']}"
        )
    rows["time a frame"] = ", ".join(f"{name} {value:.1f} ms" for name, value in summary["time_ms"].items())
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    say(table)
