"""``cmpdesign init``: writes a new design file, or a new sensor file, with every field explained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.options.designs import complete_design
from cmpdesign.cli.terminal import finish, printable_path, say

EXAMPLES = ("cmpdesign init mine", "cmpdesign init thumb --sensor layout.json --camera camera.toml")


def init(
    name: Annotated[
        Path,
        typer.Argument(metavar="NAME", help="Name of the design; NAME.toml is written. May name a folder."),
    ],
    extends: Annotated[
        str | None,
        typer.Option(
            "--extends",
            metavar="DESIGN",
            help="Begin with another design: a template's name, or the path of a file, relative to NAME's folder. "
            "[default: a honeycomb of 10 layers]",
            autocompletion=complete_design,
        ),
    ] = None,
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor", metavar="LAYOUT", help="Write a sensor file instead, for the pad of this layout."
        ),
    ] = None,
    camera: Annotated[
        list[Path] | None,
        typer.Option(
            "--camera",
            metavar="FILE",
            help="With --sensor: the file of calibrate camera for each view; the same one twice for two mirrors.",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file of this name.")] = False,
) -> None:
    """Write a commented design file, or a sensor file.

    A design file holds every field with its meaning, unit, range and default; the command build takes it. A sensor file
    names the layout and holds the views of calibrated cameras; calibrate rig takes it.
    """
    from cmpdesign.api.designs import init as write_new

    made = write_new(name, extends=extends, sensor=sensor, camera=camera or (), force=force)
    written = printable_path(made.written)
    following = f"cmpdesign build {written}"
    if sensor is not None:
        following = f"fill in [medium], then cmpdesign calibrate rig {printable_path(sensor)} {written} REST -o SENSOR"
    say(f"wrote {written}; next: {following}")
    finish(lambda: made)
