"""Options shared by the commands that work on many parts at the same time."""

from __future__ import annotations

from typing import Annotated

import typer

SchedulerOption = Annotated[
    str,
    typer.Option(
        metavar="local|dask=ADDRESS",
        help="The machine that works: this machine, or a dask scheduler by address or scheduler file.",
    ),
]

WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Number of processes on this machine. [default: one for each core]")
]
