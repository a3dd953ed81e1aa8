"""``cmpdesign init``: writes a new design file with every field explained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.options.designs import complete_design
from cmpdesign.cli.terminal import finish, printable_path, say

EXAMPLES = ("cmpdesign init mine", "cmpdesign init wider --extends tac3d")


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
    force: Annotated[bool, typer.Option("--force", help="Replace a file of this name.")] = False,
) -> None:
    """Write a commented design file.

    The file holds every field with its meaning, unit, range and default. The command build takes the file.
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
    if extends is not None:
        require_extended(extends, path)
    write_file(path, commented_toml(extends))
    say(f"wrote {printable_path(path)}; next: cmpdesign build {printable_path(path)}")
    finish(lambda: InitDocument(written=printable_path(path), extends=extends))
