"""``cmpdesign check``: lists the findings on a design."""

from __future__ import annotations

from typing import Annotated

import typer

from cmpdesign.cli.commands.build import DesignArgument, SetOption, parse_overrides
from cmpdesign.cli.pixels import parse_pixels
from cmpdesign.cli.terminal import console

EXIT_NOT_PASSED = 1
LARGEST_CAMERA_PX = 99_999


def check(
    design: DesignArgument,
    override: SetOption = None,
    camera: Annotated[
        str, typer.Option(metavar="WxH", help="Pixels of the camera whose picture the pattern fills.")
    ] = "640x480",
) -> None:
    """List what cannot be made or read. Exit code 1 when something will not work."""
    from rich.table import Table

    from cmpdesign.design.design import load_design
    from cmpdesign.layout.checks import check_design

    findings = check_design(
        load_design(design, parse_overrides(override)),
        camera_px=parse_pixels("--camera", camera, LARGEST_CAMERA_PX),
    )
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
    if any(finding.severity == "error" for finding in findings):
        raise typer.Exit(EXIT_NOT_PASSED)
