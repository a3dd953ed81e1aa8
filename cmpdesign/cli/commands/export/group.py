"""``cmpdesign export``: runs as data sets for the training of policies."""

from __future__ import annotations

import typer

from cmpdesign.cli.command import Command, Group, examples
from cmpdesign.cli.commands.export import lerobot, zarr

app = typer.Typer(
    cls=Group,
    epilog=examples(lerobot.EXAMPLES[0], zarr.EXAMPLES[0]),
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Export runs as data sets for the training of policies.",
)
app.command("lerobot", cls=Command, epilog=examples(*lerobot.EXAMPLES))(lerobot.lerobot)
app.command("zarr", cls=Command, epilog=examples(*zarr.EXAMPLES))(zarr.zarr)
