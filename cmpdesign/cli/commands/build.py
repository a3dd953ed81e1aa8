"""``cmpdesign build``: writes the files of a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.pixels import parse_pixels
from cmpdesign.cli.terminal import console, print_warning, printable_path
from cmpdesign.errors import CmpDesignError
from cmpdesign.products.registry import PRODUCTS, USUAL_NAMES, chosen_products

if TYPE_CHECKING:
    from cmpdesign.layout.report import DesignReport

DesignArgument = Annotated[str, typer.Argument(metavar="DESIGN", help="A template's name or a TOML file.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Override a parameter, as in pitch_mm=60mil; may be repeated."
    ),
]

CameraOption = Annotated[
    str, typer.Option("--camera", metavar="WxH", help="Pixels of the camera whose picture the pattern fills.")
]
CAMERA_TEXT = "640x480"
EXIT_NOT_PASSED = 1
LARGEST_CAMERA_PX = 99_999


def build(
    design: DesignArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the files; made if missing.")
    ] = Path("out"),
    override: SetOption = None,
    only: Annotated[
        str, typer.Option(metavar="NAMES", help=f"What to make, separated by commas: {', '.join(PRODUCTS)}.")
    ] = USUAL_NAMES,
    camera: CameraOption = CAMERA_TEXT,
) -> None:
    """Write a design's files: SVG, layout file, preview and report, or what --only names.

    Files in laser/, mold/, mesh/ and print/ that an earlier build made and this one does not are removed, and so
    are all files of an earlier build of another pattern, unless they were changed since. Pads of lasers, molds and
    prints are read as the camera sees them before files are written. Exit code 1 when something will not work.
    """
    from cmpdesign.design.design import load_design
    from cmpdesign.layout.build import build_layout
    from cmpdesign.products.building import build_files

    names = chosen_products(only)
    parameters = load_design(design, parse_overrides(override))
    built = build_files(parameters, build_layout(parameters), output, names, parse_camera(camera))
    for path in built.written:
        console().print(f"wrote {printable_path(path)}")
    for path in built.removed:
        console().print(f"removed {printable_path(path)}, of an earlier build")
    print_report(built.report)
    for name, reading in built.readings.items():
        console().print(f"{name} as made: {reading.line()}")
    for path in built.of_other_designs:
        print_warning(f"{printable_path(path)} belongs to another design; remove it or build it again")
    for finding in built.findings:
        verb = "will not work" if finding.severity == "error" else "may not work"
        print_warning(f"{verb}: {finding}")
    if not built.works:
        raise typer.Exit(EXIT_NOT_PASSED)


def parse_camera(text: str) -> tuple[int, int]:
    """Width and height of ``--camera``, px.

    Raises:
        CmpDesignError: another text than "640x480".
    """
    return parse_pixels("--camera", text, LARGEST_CAMERA_PX)


def parse_overrides(texts: list[str] | None) -> dict[str, str]:
    """Parse the values of ``--set`` to name -> text.

    Raises:
        CmpDesignError: a value has no name or no "=".
    """
    overrides: dict[str, str] = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise CmpDesignError(f"--set {text}: expected NAME=VALUE, as in pitch_mm=1.5mm")
        overrides[name.strip()] = value.strip()
    return overrides


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
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    console().print(table)
