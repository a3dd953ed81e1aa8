"""``cmpdesign schema``: prints the JSON Schema of a design."""

from __future__ import annotations


def schema() -> None:
    """Print the JSON Schema of a design's TOML file, for editors."""
    import sys

    from cmpdesign.design.design import design_schema_text

    sys.stdout.write(design_schema_text())
