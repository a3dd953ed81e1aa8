"""Arguments and options shared by the commands that export runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

RunsArgument = Annotated[
    list[Path],
    typer.Argument(metavar="RUN", help="Files of track or reconstruct, .npz; each file is an episode."),
]

ImagesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--images",
        metavar="SOURCE",
        help="Video or folder of images of a RUN; once for each, in order. [default: no images]",
    ),
]
