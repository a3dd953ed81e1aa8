"""Options shared by the commands that read images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.inputs.options import Channels, Preset, Side

MaxPixelsOption = Annotated[
    int,
    typer.Option(
        "--max-pixels",
        metavar="COUNT",
        min=256,
        help="Largest image that is read: width times height.",
    ),
]

ChannelsOption = Annotated[
    Channels,
    typer.Option(
        "--channels", help="rgb: the pictures' red and blue are swapped, as an RGB array saved by OpenCV."
    ),
]

SideOption = Annotated[
    Side,
    typer.Option(
        "--side", help="Side of the pattern that the camera sees; designed: as stated in the layout."
    ),
]

PresetOption = Annotated[
    Preset,
    typer.Option("--preset", help="Speed or accuracy of the positions; the ids are the same."),
]

LayoutArgument = Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")]

SourcesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE",
        help='Pictures, folders, patterns such as "run*/*.png", a video, a camera\'s number, or rtsp://...',
    ),
]
