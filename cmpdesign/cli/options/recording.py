"""Options shared by the commands that write recordings."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

OUTPUT_HELP = (
    "Table: .npz, .parquet or .csv; or recording: .mcap, .rrd, or a rosbag2 folder for a name without ending."
)

FrameIdOption = Annotated[
    str,
    typer.Option(
        "--frame-id", metavar="NAME", help="Coordinate frame and first part of the topics of a recording."
    ),
]

WithImagesOption = Annotated[
    bool, typer.Option("--with-images", help="Also record or show the frames' images, without loss.")
]

LiveOption = Annotated[
    Literal["foxglove", "rerun"] | None,
    typer.Option("--live", help="Also show the frames during the run, by a server on this machine."),
]

LivePortOption = Annotated[
    int | None,
    typer.Option(
        "--live-port",
        metavar="PORT",
        help="Port of the server; 0: any. [default: 8765 of Foxglove, 9876 of Rerun]",
    ),
]

LiveWaitOption = Annotated[
    float,
    typer.Option(
        "--live-wait", metavar="SECONDS", help="How long the first frame waits for a viewer of Foxglove."
    ),
]
