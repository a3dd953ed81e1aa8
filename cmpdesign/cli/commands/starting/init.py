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
    from cmpdesign.design.commented_toml import commented_toml
    from cmpdesign.design.extends import require_extended
    from cmpdesign.documents.designs import InitDocument
    from cmpdesign.errors import CmpDesignError
    from cmpdesign.files.atomic import write_file
    from cmpdesign.inputs.files import path_exists

    if not name.name:
        raise CmpDesignError(f"{name} is a folder; give a design's name")
    path = name if name.suffix == ".toml" else name.with_name(f"{name.name}.toml")
    if path_exists(path) and not force:
        raise CmpDesignError(f"{path}: exists already; choose another name, or replace it with --force")
    if sensor is not None or camera:
        _write_sensor(path, sensor, camera or [], extends)
        return
    if extends is not None:
        require_extended(extends, path)
    write_file(path, commented_toml(extends))
    say(f"wrote {printable_path(path)}; next: cmpdesign build {printable_path(path)}")
    finish(lambda: InitDocument(written=printable_path(path), extends=extends))


def _write_sensor(path: Path, layout: Path | None, cameras: list[Path], extends: str | None) -> None:
    from cmpdesign.documents.designs import InitDocument
    from cmpdesign.errors import CmpDesignError
    from cmpdesign.files.atomic import write_file
    from cmpdesign.sensor.commented import relative_name, sensor_text
    from cmpdesign.sensor.sensor_file import load_sensor_file, parse_sensor_file
    from extractor import load_layout

    if layout is None or not cameras or extends is not None:
        raise CmpDesignError("a sensor file needs --sensor LAYOUT and --camera FILE, and no --extends")
    load_layout(layout)
    text = sensor_text(
        path.stem, relative_name(layout, path.parent), [load_sensor_file(one) for one in cameras]
    )
    parse_sensor_file(text, str(path))
    write_file(path, text)
    say(
        f"wrote {printable_path(path)}; next: fill in [medium], then cmpdesign calibrate rig "
        f"{printable_path(layout)} {printable_path(path)} REST -o SENSOR"
    )
    finish(lambda: InitDocument(written=printable_path(path), extends=None))
