"""``cmpdesign schema``: prints the JSON Schema of a design, or of the document of a command with ``--json``."""

from __future__ import annotations

from typing import Annotated

import typer

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
    if not command:
        from cmpdesign.design.design import design_schema_text

        print_document(design_schema_text())
        return
    from cmpdesign.documents.registry import document_schema_text

    print_document(document_schema_text(" ".join(command)))
