"""``cmpdesign calibrate``: properties of one sensor, measured from its pictures."""

from __future__ import annotations

import typer

from cmpdesign.cli.command import Command, Group, examples
from cmpdesign.cli.commands.calibrate import camera, check, force, gel, pattern, rig

app = typer.Typer(
    cls=Group,
    epilog=examples(camera.EXAMPLES[0], pattern.EXAMPLES[0]),
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Measure the properties of one sensor from its pictures.",
)


app.command("camera", cls=Command, epilog=examples(*camera.EXAMPLES))(camera.camera)
app.command("check", cls=Command, epilog=examples(*check.EXAMPLES))(check.check)
app.command("force", cls=Command, epilog=examples(*force.EXAMPLES))(force.force)
app.command("gel", cls=Command, epilog=examples(*gel.EXAMPLES))(gel.gel)
app.command("pattern", cls=Command, epilog=examples(*pattern.EXAMPLES))(pattern.pattern)
app.command("rig", cls=Command, epilog=examples(*rig.EXAMPLES))(rig.rig)
