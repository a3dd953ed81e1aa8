"""Arguments of the commands that read pictures of several kinds."""

from __future__ import annotations

from typing import Annotated

import typer

SourcesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE",
        help='Pictures, folders, patterns such as "run*/*.png", a video, a camera\'s number, or rtsp://...',
    ),
]
