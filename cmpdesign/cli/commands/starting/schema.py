"""``cmpdesign schema``: prints the JSON Schema of a design, or of the document of a command with ``--json``."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from cmpdesign.api import making
from cmpdesign.cli.terminal import print_document

EXAMPLES = ("cmpdesign schema", "cmpdesign schema evaluate designs")


def schema(
    command: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="COMMAND",
            help="A command, as in verify; or message, for the lines on stderr. [default: a design's TOML file]",
        ),
    ] = None,
) -> None:
    """Print a JSON Schema.

    The schema of a design's TOML file, for editors, or of the document that COMMAND prints with --json.
    """
    found = making.schema(" ".join(command or ()))
    print_document(json.dumps(found, indent=2, ensure_ascii=False) + "\n")
