"""``cmpdesign check``: lists the findings on a design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.commands.build import (
    CAMERA_TEXT,
    EXIT_NOT_PASSED,
    CameraOption,
    DesignArgument,
    SetOption,
    parse_camera,
    parse_overrides,
)
from cmpdesign.cli.terminal import console, print_warning

if TYPE_CHECKING:
    from cmpdesign.layout.checks import Finding


def check(
    design: DesignArgument,
    override: SetOption = None,
    camera: CameraOption = CAMERA_TEXT,
    read: Annotated[
        bool, typer.Option("--read", help="Draw and read the pads that laser, mold and print would make.")
    ] = False,
) -> None:
    """List what cannot be made or read. Exit code 1 when something will not work."""
    from cmpdesign.design.design import load_design
    from cmpdesign.layout.build import build_layout
    from cmpdesign.products.building import check_products

    camera_px = parse_camera(camera)
    parameters = load_design(design, parse_overrides(override))
    checked = check_products(parameters, build_layout(parameters), camera_px, read=read)
    for name, reading in checked.readings.items():
        console().print(f"{name} as made: {reading.line()}")
    for name, reason in checked.unread.items():
        print_warning(f"{name} is not read: {reason}")
    _print_findings(checked.findings)
    if not checked.works:
        raise typer.Exit(EXIT_NOT_PASSED)


def _print_findings(findings: Sequence[Finding]) -> None:
    from rich.table import Table

    if not findings:
        console().print("nothing to report: it can be made and read")
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("severity", "what", "value", "limit", "unit", "remedy"):
        table.add_column(heading, justify="right" if heading in ("value", "limit") else "left")
    for finding in findings:
        numbers = (f"{finding.value:.3g}", f"{finding.limit:.3g}")
        table.add_row(finding.severity, finding.subject, *numbers, finding.unit, finding.remedy)
    console().print(table, soft_wrap=False)
