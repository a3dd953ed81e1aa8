"""``cmpdesign check``: lists the findings on a design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cmpdesign.api import making
from cmpdesign.cli.commands.build import EXIT_NOT_PASSED
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_warning, say, say_columns

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
    if not findings:
        say("no findings: the design can be made and read")
        return
    rows = [
        (one.severity, one.subject, f"{one.value:.3g}", f"{one.limit:.3g}", one.unit, one.remedy)
        for one in findings
    ]
    say_columns(("severity", "what", ">value", ">limit", "unit", "remedy"), rows, folds=True)
