"""Designs, products and their kerf: ``templates``, ``init``, ``size``, ``build``, ``check``, ``kerf``, ``schema``."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign import documents
from cmpdesign.api import making, workshop
from cmpdesign.cli.command import Command, app, examples
from cmpdesign.cli.derived import command
from cmpdesign.cli.records import print_parts, print_rows
from cmpdesign.cli.terminal import (
    EXIT_NEGATIVE,
    current_mode,
    print_document,
    print_warning,
    say,
    say_columns,
    say_table,
    say_text,
)
from cmpdesign.proposal import sizing

if TYPE_CHECKING:
    from cmpdesign.products.laser.grid.reading import FieldReading
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
    app, making.templates, "listing", "cmpdesign templates --kind scenes", "cmpdesign templates --show tac3d"
)
def templates(found: documents.designs.TemplatesDocument | documents.designs.TemplateDocument) -> None:
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
def init(made: documents.designs.InitDocument, given: Mapping[str, Any]) -> None:
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
def build(done: documents.designs.BuildDocument) -> int:
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
def check(done: documents.designs.CheckDocument) -> int:
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


@command(
    app,
    workshop.kerf,
    "reading the picture",
    "cmpdesign kerf coupon.json scan.png",
    "cmpdesign kerf grid.json photo.jpg --json",
)
def kerf(
    done: documents.reading.KerfDocument | documents.reading.GridDocument, given: Mapping[str, Any]
) -> None:
    """A grid of settings is read, too. The lines for the material's file are printed."""
    from cmpdesign.products.laser.coupon.design import load_coupon

    coupon, photo = load_coupon(given["coupon"]), given["photo"].name
    if done.format == "cmp-grid":
        _print_fields(done.fields)
        print_rows(done, "scale_px_mm from_back best")
        if done.best is None:
            say("\nno field cuts through with a pass in reserve: raise the power, or lower the speed")
            return
        lines = list(_settings_lines(done.found.best, photo))
    else:
        print_parts(
            done.patches,
            "name power_percent speed_mm_s passes kerf_x_mm kerf_x_back_mm kerf_y_mm kerf_y_back_mm",
        )
        print_rows(done, "scale_px_mm fit_mm response from_back face taper_deg taper_assumed thickness_mm")
        lines = [line for patch in done.patches for line in _kerf_lines(patch, done.face, photo)]
    say(f"\nfor the file of {coupon.material}, the settings of {coupon.machine}:")
    say("\n".join(lines))


def _print_fields(fields: Sequence[documents.reading.GridFieldPart]) -> None:
    """The windows of every field by their passes, and the bounds of the depth of a pass."""
    counts = [f"{count} x" for count in fields[0].windows]
    rows = []
    for one in fields:
        low, high = one.least_depth_per_pass_mm, one.most_depth_per_pass_mm
        depth = f"{low:.3g} or more" if high is None else f"{low:.3g} to {high:.3g}"
        rows.append((one.name, f"{one.power_percent:g}", f"{one.speed_mm_s:g}", *one.windows.values(), depth))
    say_columns(("name", ">power %", ">speed mm/s", *counts, "depth a pass, mm"), rows)


def _settings_lines(one: FieldReading, photo: str) -> Iterator[str]:
    """The settings that cut, with one number of passes in reserve."""
    assert one.passes is not None
    source = json.dumps(f"grid {one.name}, {photo}: through with {one.passes} passes", ensure_ascii=False)
    values = {
        "cut_power_percent": f"{one.power_percent:g}",
        "cut_speed_mm_s": f"{one.speed_mm_s:g}",
        "cut_passes": str(min(count for count in one.states if count > one.passes)),
    }
    for name, value in values.items():
        yield f"{name} = {{ value = {value}, source = {source} }}"


def _kerf_lines(patch: documents.reading.PatchPart, face: str, photo: str) -> Iterator[str]:
    """The lines of the material's file for one patch: the kerf at the front, and both faces in its source."""
    yield f"# {patch.name}: {patch.power_percent:g} %, {patch.speed_mm_s:g} mm/s, {patch.passes} times"
    for axis in "xy":
        front_mm, back_mm, sigma_mm = (
            getattr(patch, f"kerf_{axis}{which}_mm") for which in ("", "_back", "_sigma")
        )
        source = json.dumps(
            f"coupon {patch.name}, {photo}: front {front_mm:.4f} mm, back {back_mm:.4f} mm, {face} seen, "
            f"+- {sigma_mm:.4f} mm",
            ensure_ascii=False,
        )
        yield f"kerf_{axis}_mm = {{ value = {front_mm:.4f}, source = {source} }}"
