"""Options shared by the commands that read images."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

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
    Literal["bgr", "rgb"],
    typer.Option(
        "--channels", help="rgb: the pictures' red and blue are swapped, as an RGB array saved by OpenCV."
    ),
]

SideOption = Annotated[
    Literal["designed", "front", "back", "either"],
    typer.Option(
        "--side", help="Side of the pattern that the camera sees; designed: as stated in the layout."
    ),
]

PresetOption = Annotated[
    Literal["balanced", "accurate"],
    typer.Option("--preset", help="Speed or accuracy of the positions; the ids are the same."),
]

FramesOption = Annotated[int | None, typer.Option("--frames", min=1, help="Stop after this many frames.")]

SourcesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE",
        help='Pictures, folders, patterns such as "run*/*.png", a video, a camera\'s number, or rtsp://...',
    ),
]

TimesOption = Annotated[
    str | None,
    typer.Option(
        "--times",
        metavar="names|index|FILE",
        help="Times of the frames: the names' numbers, the count, or a .csv of FRAME,SECONDS. [default: what the names "
        "say; a video's own]",
    ),
]
