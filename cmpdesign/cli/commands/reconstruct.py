"""``cmpdesign reconstruct``: reconstructs the surface in space from two or more views, through a sequence."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.options.images import (
    ChannelsOption,
    FramesOption,
    MaxPixelsOption,
    PresetOption,
    SideOption,
    TimesOption,
)
from cmpdesign.cli.options.recording import (
    OUTPUT_HELP,
    FrameIdOption,
    LiveOption,
    LivePortOption,
    LiveWaitOption,
    WithImagesOption,
)
from cmpdesign.cli.options.response import METAVAR, READING_HELP, parse_reading_response
from cmpdesign.cli.run_progress import (
    exit_status,
    print_written,
    recover_and_report,
    require_positive,
    run_with_progress,
)
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.api.sequences import Followed
    from extractor.layout.reference import Reference

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
        bool,
        typer.Option("--from-rest", help="Place all views by REST, also the views whose pose RIG gives."),
    ] = False,
    flatness_mm: Annotated[
        float, typer.Option(metavar="MM", help="Largest distance of the markers from a plane at rest.")
    ] = 0.0,
    model_px: Annotated[
        float | None,
        typer.Option(metavar="PX", help="Error of the camera model, pixels. [default: from the rest frame]"),
    ] = None,
    surface: Annotated[
        bool,
        typer.Option(
            "--surface",
            help="Also write the touched surface, computed with the [elastomer] of RIG, in separate columns.",
        ),
    ] = False,
    contact: Annotated[
        Path | None,
        typer.Option(
            metavar="GEL",
            help="Also write force, torque and traction; GEL is the file of `calibrate gel`, the modulus is that "
            "of RIG's [elastomer].",
        ),
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second. [default: a video's own; 30 for a folder]")
    ] = None,
    times: TimesOption = None,
    frames: FramesOption = None,
    cold: Annotated[
        bool, typer.Option("--cold", help="Number every frame without the previous frame: slower.")
    ] = False,
    preset: PresetOption = "balanced",
    response: Annotated[str | None, typer.Option(metavar=METAVAR, help=READING_HELP)] = None,
    side: SideOption = "designed",
    channels: ChannelsOption = "bgr",
    max_pixels: MaxPixelsOption = MOST_PIXELS,
    frame_id: FrameIdOption = "tactile",
    with_images: WithImagesOption = False,
    live: LiveOption = None,
    live_port: LivePortOption = None,
    live_wait_s: LiveWaitOption = 0.0,
    recover: Annotated[
        bool, typer.Option("--recover", help="Only complete the FILE of a run that was killed.")
    ] = False,
) -> None:
    """Reconstruct a surface from several views.

    Positions, displacements and normals in mm. Exit code: 0 done, 1 ended early or nothing found, 2 bad input.
    """
    from cmpdesign.cli.documents.runs import ReconstructDocument

    if recover:
        from extractor import load_layout

        recover_and_report(output, _points_in(load_layout(layout)))
        return
    require_positive("--fps", fps)
    for option, value in (("--flatness-mm", flatness_mm), ("--model-px", model_px)):
        if value is not None and not 0 <= value < float("inf"):
            raise CmpDesignError(f"{option} is {value:g}; expected a number from 0")
    from cmpdesign.api.sequences import Reading, ReconstructJob, ShapeOptions, write_summary
    from extractor import load_layout

    known = parse_reading_response(response)
    shown = (with_images, live, live_port, live_wait_s, times)
    reading = Reading(fps, frames, cold, preset, known, side, channels, max_pixels, frame_id, *shown)
    shape = ShapeOptions(from_rest, flatness_mm, model_px, surface, contact)
    job = ReconstructJob(load_layout(layout), rig, rest, source, output, reading, shape)
    run = job.prepare()
    print_step(f"{run.source.name} is open, the views are placed")
    for warning in run.warnings:
        print_warning(warning)
    try:
        run_with_progress(run, "reconstructing")
    except OutputError:  # the summary covers the frames so far
        with suppress(OutputError):
            print_written(_print_followed(write_summary(run, job))[1:])
        raise
    followed = write_summary(run, job)
    print_written(_print_followed(followed))
    code = exit_status(run)
    written = tuple(map(printable_path, followed.written))
    finish(lambda: ReconstructDocument(**followed.summary, written=written), code)


def _points_in(layout: Reference) -> int:
    """The number of points of a frame: markers and virtual markers."""
    return len(layout.layer) + len(layout.edges) * layout.virtual_per_edge


def _print_followed(followed: Followed) -> tuple[Path, ...]:
    """Print the summary; the written files."""
    if followed.summary:
        _print_summary(followed.summary)
    return followed.written


def _describe_positions(depth_mm: float | None, is_continued: bool) -> str:
    """The surface of the positions: the cameras see the pattern, at any depth."""
    if is_continued:
        return (
            f"of the pattern, {depth_mm:g} mm below the touched surface; surface_* are of the touched surface"
        )
    if depth_mm is None:
        return "of the pattern; RIG does not state the pattern's depth below the touched surface"
    if depth_mm == 0:
        return "of the pattern, which RIG puts on the touched surface"
    return f"of the pattern, {depth_mm:g} mm below the touched surface; not of the touched surface"


def _print_summary(summary: Mapping[str, Any]) -> None:
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
