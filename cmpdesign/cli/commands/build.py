"""``cmpdesign build``: writes the files of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmpdesign.api import making
from cmpdesign.cli.derived import derived
from cmpdesign.cli.terminal import print_warning, printable_path, say, say_table

if TYPE_CHECKING:
    from cmpdesign.documents.designs import BuildDocument
    from cmpdesign.layout.report import DesignReport

EXIT_NOT_PASSED = 1
EXAMPLES = (
    "cmpdesign build tac3d -o mine --set pitch_mm=60mil",
    "cmpdesign build mine.toml -o made --only svg,laser",
)


@derived(making.build, "building")
def build(done: BuildDocument) -> int:
    """The files are the SVG, the layout file, a preview and a report, or the products that --only names.

    Files in laser/, mold/, mesh/ and print/ that an earlier build made and this build does not make are removed, and so
    are all files of an earlier build of another pattern, unless they were changed since. Pads of lasers, molds and
    prints are read as the camera sees the pads before files are written. Exit code 1: a finding is an error.
    """
    built = done.found
    for path in done.written:
        say(f"wrote {printable_path(path)}")
    for path in done.removed:
        say(f"removed {printable_path(path)}: written by an earlier build")
    print_report(built.report)
    for name, reading in built.readings.items():
        say(f"{name} as made: {reading.line()}")
    for other in built.of_other_designs:
        print_warning(
            f"{printable_path(other)} belongs to another design; remove the file, or build that design again"
        )
    for finding in built.findings:
        verb = "will not work" if finding.severity == "error" else "may not work"
        print_warning(f"{verb}: {finding}")
    return 0 if built.works else EXIT_NOT_PASSED


def print_report(report: DesignReport) -> None:
    """Print the key figures of a design."""
    cells = ", ".join(f"{count} {color}" for color, count in report.cells.items() if count)
    absent = report.markers - report.present_markers
    rows = {
        "pattern": f"{report.pattern}, {report.layers} layers, pitch {report.pitch_mm:.4g} mm",
        "markers": f"{report.present_markers}" + (f" ({absent} more ids are never seen)" if absent else ""),
        "virtual markers": f"{report.virtual_markers} on {report.edges} edges ({report.points} points)",
        "cells": f"{sum(report.cells.values())}: {cells}",
        "overall size": "{:.2f} x {:.2f} mm, border included".format(*report.size_mm),
        "smallest feature": f"{report.smallest_feature_mm:.3f} mm (circle inside the narrowest cell)",
    }
    if report.code is not None:
        rows["code"] = report.code.line()
    say_table(rows)
