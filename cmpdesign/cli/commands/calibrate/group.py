"""``cmpdesign calibrate``: properties of one sensor, measured from its pictures."""

from __future__ import annotations

import typer

from cmpdesign.cli.command import Command, Group, examples
from cmpdesign.cli.commands.calibrate import force, gel, pattern

app = typer.Typer(
    cls=Group,
    epilog=examples(*pattern.EXAMPLES),
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Measure the properties of one sensor from its pictures.",
)


@app.callback()
def group() -> None:
    """Measure one sensor."""


app.command("force", cls=Command, epilog=examples(*force.EXAMPLES))(force.force)
app.command("gel", cls=Command, epilog=examples(*gel.EXAMPLES))(gel.gel)
app.command("pattern", cls=Command, epilog=examples(*pattern.EXAMPLES))(pattern.pattern)
