"""``cmpdesign check``: lists the findings on a design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cmpdesign.api import making
from cmpdesign.cli.commands.build import EXIT_NOT_PASSED
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_warning, say

if TYPE_CHECKING:
    from cmpdesign.documents.designs import CheckDocument
    from cmpdesign.layout.checks import Finding

EXAMPLES = (
    "cmpdesign check tac3d --set pitch_mm=0.5mm",
    "cmpdesign check mine.toml --read --camera 1280x960",
)


@derived(making.check, "checking")
def check(done: CheckDocument) -> int:
    """Exit code 1: a finding is an error."""
    checked = done.found
    for name, reading in checked.readings.items():
        say(f"{name} as made: {reading.line()}")
    for name, reason in checked.unread.items():
        print_warning(f"{name} is not read: {reason}")
    if checked.code is not None:
        say(f"code {checked.code.line()}")
    _print_findings(checked.findings)
    return 0 if done.passed else EXIT_NOT_PASSED


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
