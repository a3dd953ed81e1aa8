"""``cmpdesign view``: the live part of the page over a camera, a video or pictures."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from cmpdesign.cli.commands.pages.studio import HOST, PORT, BrowserOption, HostOption, PortOption, announce
from cmpdesign.cli.options.images import LayoutArgument, SourcesArgument
from cmpdesign.errors import CmpDesignError

EXAMPLES = (
    "cmpdesign view layout.json 0",
    "cmpdesign view layout.json press.mp4 -o run.npz --no-browser",
)
_END_S = 5.0  # for the last frame of a run


def view(
    layout: LayoutArgument,
    source: SourcesArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Also record into this table or recording, as track does."),
    ] = None,
    rest: Annotated[
        str | None,
        typer.Option(help="Frame or image from which displacement is counted. [default: first frame]"),
    ] = None,
    rig: Annotated[
        Path | None, typer.Option(help="The views, .toml: show the surface, as reconstruct does.")
    ] = None,
    contact: Annotated[Path | None, typer.Option(metavar="GEL", help="With --rig: show forces, too.")] = None,
    port: PortOption = PORT,
    host: HostOption = HOST,
    no_browser: BrowserOption = False,
) -> None:
    """Show the markers of a camera, a video or pictures live in the browser; with a rig the surface and forces.

    The page is that of studio, at its live part. The run goes at the camera's rate, whatever the page shows.
    Ctrl-C ends it.
    """
    from cmpdesign.studio.live import LiveFeed, NoSink
    from cmpdesign.studio.serving import serve
    from cmpdesign.tracking.jobs.job import write_summary

    if contact is not None and rig is None:
        raise CmpDesignError("--contact needs --rig: forces are read from displacement in space")
    with tempfile.TemporaryDirectory(prefix="cmpdesign-view-") as folder:
        job = _job(layout, source, output or Path(folder) / "run.npz", rest, rig, contact)
        run = job.prepare()
        if output is None:
            run.sink.close()
            run.sink = NoSink()
        feed = LiveFeed(run.source.name, job.layout, is_paced=not run.source.is_live)
        thread = feed.follow(run)
        try:
            serve(host, port, announce, with_browser=not no_browser, live=feed)
        finally:
            run.stop.is_requested = True
            thread.join(_END_S)
            if output is not None and run.statistics.frames:
                write_summary(run, job)


def _job(
    layout: Path, source: list[str], output: Path, rest: str | None, rig: Path | None, contact: Path | None
) -> Any:
    """The work of ``track``, or with a rig of ``reconstruct``."""
    from cmpdesign.api.sequences import reconstruct_job, track_job

    if rig is None:
        return track_job(layout, source, output, rest=rest)
    return reconstruct_job(layout, rig, rest or "0", source, output, contact=contact)
