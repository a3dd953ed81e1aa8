"""``cmpdesign calibrate``: properties of one sensor, measured from its pictures."""

from __future__ import annotations

from cmpdesign.cli.command import Command, examples, new_group
from cmpdesign.cli.commands.calibrate import camera, check, force, gel, pattern, rig

app = new_group(
    "Measure the properties of one sensor from its pictures.", camera.EXAMPLES[0], pattern.EXAMPLES[0]
)
for module, function in (
    (camera, camera.camera),
    (check, check.check),
    (force, force.force),
    (gel, gel.gel),
    (pattern, pattern.pattern),
    (rig, rig.rig),
):
    app.command(function.__name__, cls=Command, epilog=examples(*module.EXAMPLES))(function)
