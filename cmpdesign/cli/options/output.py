"""The options of output that every command has."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.main import get_command

JsonOption = Annotated[
    bool,
    typer.Option(
        "--json",
        help="Print one JSON document in place of text, and errors and warnings as JSON lines on stderr.",
    ),
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print errors and warnings only; no progress.")
]
VerboseOption = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        help="Also print each step with its time, and the place in the code where an error arose.",
    ),
]
NAMES = ("as_json", "quiet", "verbose")


def output_parameters() -> list[Any]:
    """The three options as parameters of a command; the command's function does not receive them."""
    carrier = typer.Typer(add_completion=False)

    @carrier.command()
    def carry(
        as_json: JsonOption = False, quiet: QuietOption = False, verbose: VerboseOption = False
    ) -> None:
        """Carries the options."""

    return [parameter for parameter in get_command(carrier).params if parameter.name in NAMES]
