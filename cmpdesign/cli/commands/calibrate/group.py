"""``cmpdesign calibrate``: properties of one sensor, measured from its pictures."""

from __future__ import annotations

import typer

from cmpdesign.cli.command import Command, Group, examples
from cmpdesign.cli.commands.calibrate import pattern

app = typer.Typer(
    cls=Group,
    epilog=examples(*pattern.EXAMPLES),
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Measure the properties of one sensor from its pictures.",
)


@app.callback()
def group() -> None:
    """Keep the command's name although the group has one command."""


app.command("pattern", cls=Command, epilog=examples(*pattern.EXAMPLES))(pattern.pattern)
