"""Options that commands share which read images."""

from __future__ import annotations

from typing import Annotated

import typer

MaxPixelsOption = Annotated[
    int,
    typer.Option(
        "--max-pixels",
        metavar="COUNT",
        min=256,
        help="Largest image that is read: its width times its height.",
    ),
]
