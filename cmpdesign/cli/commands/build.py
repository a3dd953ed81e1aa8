"""``cmpdesign build``: writes the files of a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.products.registry import PRODUCTS, USUAL_NAMES, chosen_products

if TYPE_CHECKING:
    from cmpdesign.layout.report import DesignReport

EXIT_NOT_PASSED = 1
EXAMPLES = (
    "cmpdesign build tac3d -o mine --set pitch_mm=60mil",
    "cmpdesign build mine.toml -o made --only svg,laser",
)


def build(
    design: DesignArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the files; made if missing.")
    ] = Path("out"),
    override: SetOption = None,
    products: Annotated[
        str,
        typer.Option(
            "--only", metavar="NAMES", help=f"Products to make, separated by commas: {', '.join(PRODUCTS)}."
        ),
    ] = USUAL_NAMES,
    camera: CameraOption = CAMERA_TEXT,
    preset: PresetOption = "balanced",
) -> None:
    """Write a design's files.

    The files are the SVG, the layout file, a preview and a report, or the products that --only names.
    Files in laser/, mold/, mesh/ and print/ that an earlier build made and this build does not make are removed, and so
    are all files of an earlier build of another pattern, unless they were changed since. Pads of lasers, molds and
    prints are read as the camera sees the pads before files are written. Exit code 1: a finding is an error.
    """
    from cmpdesign.design.design import load_design
    from cmpdesign.documents.designs import BuildDocument, finding_parts, reading_parts
    from cmpdesign.layout.build import build_layout
    from cmpdesign.layout.report import report_values
    from cmpdesign.products.building import build_files
    from cmpdesign.watch import watched

    names, camera_px = chosen_products(products), parse_camera(camera)
    parameters = load_design(design, parse_overrides(override))
    layout = build_layout(parameters)
    print_step(
        f"{parameters.name}: layout of {len(layout.marker_xy_mm)} markers, digest {layout.digest[:12]}"
    )
    with working("building") as steps, watched(steps.tell):
        built = build_files(parameters, layout, output, names, camera_px, preset=preset)
    for path in built.written:
        say(f"wrote {printable_path(path)}")
    for path in built.removed:
        say(f"removed {printable_path(path)}: written by an earlier build")
    print_report(built.report)
    for name, reading in built.readings.items():
        say(f"{name} as made: {reading.line()}")
    for path in built.of_other_designs:
        print_warning(
            f"{printable_path(path)} belongs to another design; remove the file, or build that design again"
        )
    for finding in built.findings:
        verb = "will not work" if finding.severity == "error" else "may not work"
        print_warning(f"{verb}: {finding}")
    finish(
        lambda: BuildDocument(
            digest=layout.digest,
            folder=printable_path(output),
            written=tuple(map(printable_path, built.written)),
            removed=tuple(map(printable_path, built.removed)),
            report={name: value for name, value in report_values(built.report).items() if name != "findings"},
            as_made=reading_parts(built.readings),
            findings=finding_parts(built.findings),
        ),
        0 if built.works else EXIT_NOT_PASSED,
    )


def print_report(report: DesignReport) -> None:
    """Print the key figures of a design."""
    from rich.table import Table

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
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    say(table)
