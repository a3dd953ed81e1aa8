"""``cmpdesign init``: writes a new design file, or a new sensor file, with every field explained."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cmpdesign.api import making
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import finish, printable_path, say

EXAMPLES = ("cmpdesign init mine", "cmpdesign init thumb --sensor layout.json --camera camera.toml")


@derived(making.init)
def init(name: Path, sensor: Path | None, **options: Any) -> None:
    """A design file holds every field with its meaning, unit, range and default; the command build takes it. A sensor
    file names the layout and holds the views of calibrated cameras; calibrate rig takes it.
    """
    made = making.init(name, sensor=sensor, **options)
    written = printable_path(made.written)
    following = f"cmpdesign build {written}"
    if sensor is not None:
        following = f"fill in [medium], then cmpdesign calibrate rig {printable_path(sensor)} {written} REST -o SENSOR"
    say(f"wrote {written}; next: {following}")
    finish(lambda: made)
