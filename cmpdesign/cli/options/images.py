"""Arguments of the commands that read pictures of several kinds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

LayoutArgument = Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")]

SourcesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE",
        help='Pictures, folders, patterns such as "run*/*.png", a video, a camera\'s number, or rtsp://...',
    ),
]
