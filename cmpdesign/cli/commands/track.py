"""``cmpdesign track``: tracks a pattern through a video, a folder of images or the frames of a camera."""

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
    SourcesArgument,
    TimesOption,
)
from cmpdesign.cli.options.paths import require_suffix
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
from cmpdesign.errors import OutputError
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.api.sequences import Followed

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
            metavar="N|IMAGE",
            help="Frame or image from which displacement is counted. [default: the first tracked frame]",
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
    times: TimesOption = None,
    frames: FramesOption = None,
    overlay: Annotated[
        Path | None, typer.Option(metavar="VIDEO", help="Video of the found markers: .mp4, .avi or .mkv.")
    ] = None,
    quiver: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Arrows of the frame with the largest displacement.")
    ] = None,
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
    """Follow a pattern through a sequence.

    Exit code: 0 done, 1 ended early or nothing tracked, 2 bad input or full disk.
    """
    from cmpdesign.cli.documents.runs import TrackDocument

    if recover:
        from extractor import load_layout

        recover_and_report(output, len(load_layout(layout).layer))
        return
    require_positive("--mm-per-px", mm_per_px)
    require_positive("--fps", fps)
    require_suffix("--quiver", quiver, [".png"])
    from cmpdesign.api.sequences import Reading, TrackJob, write_summary
    from extractor import load_layout

    known = parse_reading_response(response)
    shown = (with_images, live, live_port, live_wait_s, times)
    reading = Reading(fps, frames, cold, preset, known, side, channels, max_pixels, frame_id, *shown)
    job = TrackJob(load_layout(layout), tuple(source), output, reading, rest, mm_per_px, overlay, quiver)
    run = job.prepare()
    print_step(f"{run.source.name} is open")
    try:
        run_with_progress(run, "tracking")
    except OutputError:  # the summary covers the frames so far
        with suppress(OutputError):
            print_written(_print_followed(write_summary(run, job), quiver)[1:])
        raise
    followed = write_summary(run, job)
    print_written(_print_followed(followed, quiver))
    code = exit_status(run)
    finish(
        lambda: TrackDocument(**followed.summary, written=tuple(map(printable_path, followed.written))), code
    )


def _print_followed(followed: Followed, quiver: Path | None) -> tuple[Path, ...]:
    """Print the summary; the written files."""
    if followed.summary:
        _print_summary(followed.summary)
        if quiver is not None and quiver not in followed.written:
            print_warning(f"{printable_path(quiver)} is not drawn: no frame has a displacement")
    return followed.written


def _print_summary(summary: Mapping[str, Any]) -> None:
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
            rows["remedy"] = "; ".join(summary["quality"]["hints"])
    if largest is not None:
        mm = "" if largest["mm"] is None else f" = {largest['mm']:.4g} mm"
        rows["largest displacement"] = (
            f"{largest['px']:.3f} px{mm}, marker {largest['marker']} in frame {largest['frame']}"
        )
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    say(table)
