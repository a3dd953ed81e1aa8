"""``cmpdesign serve``: the sensors of a robot for viewers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.mode import current_mode
from cmpdesign.cli.terminal import finish, print_document, say

if TYPE_CHECKING:
    from cmpdesign.runtime.opening import Sensors

EXAMPLES = (
    "cmpdesign serve thumb.toml index.toml",
    "cmpdesign serve thumb.toml --output markers --port 0 --record run.mcap",
)
_LOOK_S = 0.2


def serve(
    sensors: Annotated[
        list[Path],
        typer.Argument(metavar="SENSOR", help="Sensor files with a [camera].", show_default=False),
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
    from cmpdesign.documents.runs import ServeDocument
    from cmpdesign.runtime.opening import open_sensor
    from cmpdesign.runtime.publish.serving import SensorServer

    with open_sensor(*sensors, outputs=output) as opened:
        if record is not None:
            opened.record(record)
        server = SensorServer(opened, port)
        try:
            if current_mode().as_json:
                finish(lambda: ServeDocument(address=server.address))
            else:
                print_document(f"{server.address}\n")
            _tell_events(opened)
        finally:
            server.close()


def _tell_events(sensors: Sensors) -> None:
    """Print the events of the cameras until Ctrl-C or SIGTERM, after which recordings are completed."""
    import time

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
