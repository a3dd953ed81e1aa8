"""Designs, sensor files and their products: ``templates``, ``init``, ``size``, ``build``, ``check``, ``schema``."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.api import making
from cmpdesign.cli.command import Command, app, examples
from cmpdesign.cli.derived import command
from cmpdesign.cli.records import print_parts
from cmpdesign.cli.terminal import (
    EXIT_NEGATIVE,
    current_mode,
    print_document,
    print_warning,
    say,
    say_table,
    say_text,
)
from cmpdesign.proposal import sizing

if TYPE_CHECKING:
    from cmpdesign.documents.designs import (
        BuildDocument,
        CheckDocument,
        InitDocument,
        TemplateDocument,
        TemplatesDocument,
    )
    from cmpdesign.proposal.camera_design import Proposal

# The command or option that takes the names of a kind.
TAKERS = {
    "designs": "for build, check, init --extends and evaluate designs",
    "scenes": "for render --scene",
    "plans": "for dataset",
    "machines": "for --set laser.machine=NAME",
    "materials": "for --set laser.material=NAME",
    "silicones": "for --set mold.base_silicone=NAME, marker_silicone, cover_silicone",
    "sensors": "for evaluate --sensor",
}


@command(
    app,
    making.templates,
    "listing",
    "cmpdesign templates --kind scenes",
    "cmpdesign templates --show tac3d",
)
def templates(found: TemplatesDocument | TemplateDocument) -> None:
    """Templates are designs, scenes, plans of data sets, machines, materials, silicones and sensors."""
    if hasattr(found, "text"):
        if not current_mode().as_json:
            print_document(found.text)
        return
    gap = ""
    for kind, listed in groupby(found.templates, key=lambda each: each.kind):
        say(f"{gap}{kind} ({TAKERS[kind]})")
        print_parts(
            list(listed), "name description source" if kind == "designs" else "name description", folds=True
        )
        gap = "\n"


@command(
    app,
    making.init,
    "writing",
    "cmpdesign init mine",
    "cmpdesign init thumb --sensor layout.json --camera camera.toml",
)
def init(made: InitDocument, given: Mapping[str, Any]) -> None:
    """A design file holds every field with its meaning, unit, range and default; the command build takes it. A sensor
    file names the layout and holds the views of calibrated cameras; calibrate rig takes it.
    """
    following = f"cmpdesign build {made.written}"
    if given["sensor"] is not None:
        rig = f"cmpdesign calibrate rig {given['sensor']} {made.written} REST -o SENSOR"
        following = f"fill in [medium], then {rig}"
    say(f"next: {following}")


@command(
    app,
    sizing.size,
    "comparing patterns",
    "cmpdesign size --camera 1280x960 --view 24x18mm",
    "cmpdesign size --camera 640x480 --view 20x15mm --make mold -o sized.toml",
)
def size(done: Proposal, given: Mapping[str, Any]) -> None:
    """The design is printed as TOML, or written into a file for build."""
    say_table(done.figures())
    output = given["output"]
    if output is None:
        say_text(f"\n{done.to_toml()}\n# next: the same with -o sized.toml\n")
        return
    say(f"wrote {output}")
    say_text(f"next: {done.next_command.replace('DESIGN.toml', shlex.quote(str(output)))}\n")


@command(
    app,
    making.build,
    "building",
    "cmpdesign build tac3d -o mine --set pitch_mm=60mil",
    "cmpdesign build mine.toml -o made --only svg,laser",
)
def build(done: BuildDocument) -> int:
    """The files are the SVG, the layout file, a preview and a report, or the products that --only names.

    Files in laser/, mold/, mesh/ and print/ that an earlier build made and this build does not make are removed, and so
    are all files of an earlier build of another pattern, unless they were changed since. Pads of lasers, molds and
    prints are read as the camera sees the pads before files are written. Exit code 1: a finding is an error.
    """
    built = done.found
    for path in done.removed:
        say(f"removed {path}: written by an earlier build")
    say_table(built.report.figures())
    _say_readings(built.readings)
    for other in built.of_other_designs:
        print_warning(f"{other} belongs to another design; remove the file, or build that design again")
    for finding in built.findings:
        verb = "will not work" if finding.severity == "error" else "may not work"
        print_warning(f"{verb}: {finding}")
    return 0 if built.works else EXIT_NEGATIVE


@command(
    app,
    making.check,
    "checking",
    "cmpdesign check tac3d --set pitch_mm=0.5mm",
    "cmpdesign check mine.toml --read --camera 1280x960",
)
def check(done: CheckDocument) -> int:
    """Exit code 1: a finding is an error."""
    _say_readings(done.found.readings)
    for name, reason in done.not_read.items():
        print_warning(f"{name} is not read: {reason}")
    if done.found.code is not None:
        say(f"code {done.found.code.line()}")
    if done.findings:
        print_parts(done.findings, folds=True)
    else:
        say("no findings: the design can be made and read")
    return 0 if done.passed else EXIT_NEGATIVE


def _say_readings(readings: Mapping[str, Any]) -> None:
    for name, reading in readings.items():
        say(f"{name} as made: {reading.line()}")


@app.command(cls=Command, epilog=examples("cmpdesign schema", "cmpdesign schema evaluate designs"))
def schema(
    command: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="COMMAND",
            help="A command, as in verify; or message, for the lines on stderr. [default: a design's TOML file]",
        ),
    ] = None,
) -> None:
    """Print a JSON Schema.

    The schema of a design's TOML file, for editors, or of the document that COMMAND prints with --json.
    """
    found = making.schema(" ".join(command or ()))
    print_document(json.dumps(found, indent=2, ensure_ascii=False) + "\n")
