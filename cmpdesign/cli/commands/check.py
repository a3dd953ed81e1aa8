"""``cmpdesign check``: lists the findings on a design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from cmpdesign.cli.terminal import finish, print_warning, say

if TYPE_CHECKING:
    from cmpdesign.layout.checks import Finding
    from cmpdesign.products.as_made.reading import PadReading

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
    """List what cannot be made or read. Exit code 1 when something will not work."""
    from cmpdesign.cli.documents.designs import CheckDocument, finding_parts, reading_parts
    from cmpdesign.design.design import load_design
    from cmpdesign.layout.build import build_layout
    from cmpdesign.layout.checks import check_design
    from cmpdesign.products.as_made.reading import clip_findings

    camera_px = parse_camera(camera)
    parameters = load_design(design, parse_overrides(override))
    layout = build_layout(parameters)
    findings = [*check_design(parameters, layout, camera_px), *clip_findings(layout, camera_px)]
    readings: Mapping[str, PadReading] = {}
    reasons: dict[str, str] = {}
    if read:
        from cmpdesign.products.as_made.reading import read_pads
        from cmpdesign.products.registry import pads_as_made

        with working("drawing and reading pads"):
            pads, reasons = pads_as_made(parameters, layout)
            found = read_pads(pads, camera_px, preset)
        readings = found.readings
        for name, reading in readings.items():
            say(f"{name} as made: {reading.line()}")
        for name, reason in reasons.items():
            print_warning(f"{name} is not read: {reason}")
        findings = sorted([*findings, *found.findings], key=lambda finding: finding.severity)
    _print_findings(findings)
    passed = all(finding.severity != "error" for finding in findings)
    finish(
        lambda: CheckDocument(
            digest=layout.digest,
            passed=passed,
            as_made=reading_parts(readings),
            not_read=reasons,
            findings=finding_parts(findings),
        ),
        0 if passed else EXIT_NOT_PASSED,
    )


def _print_findings(findings: Sequence[Finding]) -> None:
    from rich.table import Table

    if not findings:
        say("nothing to report: it can be made and read")
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("severity", "what", "value", "limit", "unit", "remedy"):
        table.add_column(heading, justify="right" if heading in ("value", "limit") else "left")
    for finding in findings:
        numbers = (f"{finding.value:.3g}", f"{finding.limit:.3g}")
        table.add_row(finding.severity, finding.subject, *numbers, finding.unit, finding.remedy)
    say(table, soft_wrap=False)
