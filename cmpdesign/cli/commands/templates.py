"""``cmpdesign templates``: lists the shipped designs."""

from __future__ import annotations


def templates() -> None:
    """List the designs that are shipped; build takes their names."""
    from rich.table import Table

    from cmpdesign.cli.terminal import console
    from cmpdesign.design import templates as shipped
    from cmpdesign.design.design import load_design

    table = Table(box=None, pad_edge=False)
    for heading in ("name", "pattern", "description", "source"):
        table.add_column(heading, overflow="fold")
    for name in shipped.templates():
        design = load_design(name)
        table.add_row(name, design.pattern, design.description, design.source)
    console().print(table, soft_wrap=False)
