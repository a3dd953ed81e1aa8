"""Options that the commands share which write recordings."""

from __future__ import annotations

from typing import Annotated

import typer

OUTPUT_HELP = "Table: .npz, .parquet or .csv; or recording: .mcap, or without ending a rosbag2 folder."

FrameIdOption = Annotated[
    str,
    typer.Option(
        "--frame-id", metavar="NAME", help="Coordinate frame and first part of the topics of a recording."
    ),
]

WithImagesOption = Annotated[
    bool, typer.Option("--with-images", help="Also record the frames' images, without loss.")
]
