"""Servers of this machine, until Ctrl-C: the page of ``studio`` and ``view``, the results of ``serve`` for viewers."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign import documents
from cmpdesign.cli.command import Command, app, examples
from cmpdesign.cli.options import SourcesArgument
from cmpdesign.cli.terminal import current_mode, finish, print_document, say
from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from cmpdesign.runtime.opening import Sensors

PortOption = Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0: any free port.")]
HostOption = Annotated[
    str, typer.Option(help="Address to listen on; another than 127.0.0.1 lets other machines use the page.")
]
BrowserOption = Annotated[bool, typer.Option("--no-browser", help="Print the address only.")]
_END_S = 5.0  # for the last frame of a run
_LOOK_S = 0.2


@app.command(cls=Command, epilog=examples("cmpdesign studio", "cmpdesign studio --port 0 --no-browser"))
def studio(
    port: PortOption = 8300, host: HostOption = "127.0.0.1", no_browser: BrowserOption = False
) -> None:
    """Design, check, make and read a pad in the browser.

    One line on standard output is the page's address; it holds the token without which no request is answered. The
    page asks no other machine for anything. Ctrl-C ends it.
    """
    from cmpdesign.studio.serving import serve as serve_page

    serve_page(host, port, _announce, with_browser=not no_browser)


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign view layout.json 0", "cmpdesign view layout.json press.mp4 -o run.npz --no-browser"
    ),
)
def view(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
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
    port: PortOption = 8300,
    host: HostOption = "127.0.0.1",
    no_browser: BrowserOption = False,
) -> None:
    """Show the markers of a camera, a video or pictures live in the browser; with a rig the surface and forces.

    The page is that of studio, at its live part. The run goes at the camera's rate, whatever the page shows.
    Ctrl-C ends it.
    """
    from cmpdesign.api.sequences import reconstruct_job, track_job
    from cmpdesign.studio.live import LiveFeed, NoSink
    from cmpdesign.studio.serving import serve as serve_page
    from cmpdesign.tracking.jobs.job import write_summary

    if contact is not None and rig is None:
        raise CmpDesignError("--contact needs --rig: forces are read from displacement in space")
    with tempfile.TemporaryDirectory(prefix="cmpdesign-view-") as folder:
        file = output or Path(folder) / "run.npz"
        job: Any = (
            track_job(layout, source, file, rest=rest)
            if rig is None
            else reconstruct_job(layout, rig, rest or "0", source, file, contact=contact)
        )
        run = job.prepare()
        if output is None:
            run.sink.close()
            run.sink = NoSink()
        feed = LiveFeed(run.source.name, job.layout, is_paced=not run.source.is_live)
        thread = feed.follow(run)
        try:
            serve_page(host, port, _announce, with_browser=not no_browser, live=feed)
        finally:
            run.stop.is_requested = True
            thread.join(_END_S)
            if output is not None and run.statistics.frames:
                write_summary(run, job)


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign serve thumb.toml index.toml",
        "cmpdesign serve thumb.toml --output markers --port 0 --record run.mcap",
    ),
)
def serve(
    sensors: Annotated[
        list[Path], typer.Argument(metavar="SENSOR", help="Sensor files with a [camera].", show_default=False)
    ],
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            metavar="NAME",
            help="markers, virtual, shape or contact; may be repeated. "
            "[default: all that a file allows, without virtual]",
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port of the server; 0: any free port. [default: 8765]"),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Also record all results, and gaps of the cameras, into this .mcap file."
        ),
    ] = None,
) -> None:
    """Run sensors and publish their newest results for Foxglove, on the topics of recordings.

    One line on standard output is the server's address; only this machine can connect. Events of the cameras, as a
    gap, are printed. Ctrl-C ends it.
    """
    from cmpdesign.runtime.opening import open_sensor
    from cmpdesign.runtime.publish.serving import SensorServer

    with open_sensor(*sensors, outputs=output) as opened:
        if record is not None:
            opened.record(record)
        server = SensorServer(opened, port)
        try:
            _announce(server.address, documents.runs.ServeDocument)
            _tell_events(opened)
        finally:
            server.close()


def _announce(address: str, document: Any = None) -> None:
    """Print an address: a line, or with ``--json`` its document; without another one that of the page."""
    if current_mode().as_json:
        finish((document or documents.designs.StudioDocument)(address=address))
    else:
        print_document(f"{address}\n")


def _tell_events(sensors: Sensors) -> None:
    """Print the events of the cameras until Ctrl-C or SIGTERM, after which recordings are completed."""
    from cmpdesign.tracking.run import StopRequest, stop_on_signal

    told, stop = dict.fromkeys((one.name for one in sensors), 0), StopRequest()
    with stop_on_signal(stop):
        while not stop.is_requested:
            time.sleep(_LOOK_S)
            for sensor in sensors:
                events = sensor.events_since(told[sensor.name])
                told[sensor.name] += len(events)
                for event in events:
                    say(f"{sensor.name}: {event}")
