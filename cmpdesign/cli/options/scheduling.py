"""Options that the commands share which work on many parts at the same time."""

from __future__ import annotations

from typing import Annotated

import typer

SchedulerOption = Annotated[
    str,
    typer.Option(
        metavar="local|dask=ADDRESS",
        help="This machine, or a dask scheduler by its address or scheduler file.",
    ),
]

WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Processes on this machine. [default: one for each core]")
]
