"""``cmpdesign check``: lists the findings on a design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.commands.build import EXIT_NOT_PASSED
from cmpdesign.cli.options.designs import (
    CAMERA_TEXT,
    CameraOption,
    DesignArgument,
    SetOption,
    parse_camera,
    parse_overrides,
)
from cmpdesign.cli.options.images import PresetOption
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, say

if TYPE_CHECKING:
    from cmpdesign.layout.checks import Finding

EXAMPLES = (
    "cmpdesign check tac3d --set pitch_mm=0.5mm",
    "cmpdesign check mine.toml --read --camera 1280x960",
)


def check(
    design: DesignArgument,
    override: SetOption = None,
    camera: CameraOption = CAMERA_TEXT,
    read: Annotated[
        bool, typer.Option("--read", help="Draw and read the pads that laser, mold and print would make.")
    ] = False,
    preset: PresetOption = "balanced",
) -> None:
    """List the features of a design that cannot be made or read. Exit code 1: a finding is an error."""
    from cmpdesign.design.design import load_design
    from cmpdesign.documents.designs import CheckDocument, finding_parts, reading_parts
    from cmpdesign.layout.build import build_layout
    from cmpdesign.patterns.pad_code import code_figures
    from cmpdesign.products.building import check_products
    from cmpdesign.watch import watched

    camera_px = parse_camera(camera)
    parameters = load_design(design, parse_overrides(override))
    layout = build_layout(parameters)
    print_step(f"{parameters.name}: layout of {len(layout.marker_xy_mm)} markers")
    with working("drawing and reading pads" if read else "checking") as steps, watched(steps.tell):
        checked = check_products(parameters, layout, camera_px, read=read, preset=preset)
    for name, reading in checked.readings.items():
        say(f"{name} as made: {reading.line()}")
    for name, reason in checked.unread.items():
        print_warning(f"{name} is not read: {reason}")
    if layout.code is not None:
        say(f"code {code_figures(int(layout.parameters['layers']), layout.code).line()}")
    _print_findings(checked.findings)
    finish(
        lambda: CheckDocument(
            digest=layout.digest,
            passed=checked.works,
            as_made=reading_parts(checked.readings),
            not_read=dict(checked.unread),
            findings=finding_parts(checked.findings),
        ),
        0 if checked.works else EXIT_NOT_PASSED,
    )


def _print_findings(findings: Sequence[Finding]) -> None:
    from rich.table import Table

    if not findings:
        say("no findings: the design can be made and read")
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("severity", "what", "value", "limit", "unit", "remedy"):
        table.add_column(heading, justify="right" if heading in ("value", "limit") else "left")
    for finding in findings:
        numbers = (f"{finding.value:.3g}", f"{finding.limit:.3g}")
        table.add_row(finding.severity, finding.subject, *numbers, finding.unit, finding.remedy)
    say(table, soft_wrap=False)
