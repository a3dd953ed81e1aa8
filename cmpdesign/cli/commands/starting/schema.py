"""``cmpdesign schema``: prints the JSON Schema of a design."""

from __future__ import annotations


def schema() -> None:
    """Print the JSON Schema of a design's TOML file, for editors."""
    from cmpdesign.cli.terminal import print_document
    from cmpdesign.design.design import design_schema_text

    print_document(design_schema_text())
