"""``cmpdesign build``: a design's files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.terminal import console, print_warning, printable_path
from cmpdesign.errors import CmpDesignError
from cmpdesign.products.registry import PRODUCTS, USUAL_NAMES, chosen_products, make_products, product_folders

if TYPE_CHECKING:
    from cmpdesign.layout.report import DesignReport

DesignArgument = Annotated[str, typer.Argument(metavar="DESIGN", help="A template's name or a TOML file.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Override a parameter, as in pitch_mm=60mil; may be repeated."
    ),
]


def build(
    design: DesignArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the files; made if missing.")
    ] = Path("out"),
    override: SetOption = None,
    only: Annotated[
        str, typer.Option(metavar="NAMES", help=f"What to make, separated by commas: {', '.join(PRODUCTS)}.")
    ] = USUAL_NAMES,
) -> None:
    """Write a design's files: SVG, layout file, preview and report, or what --only names.

    Files in laser/, mold/, mesh/ and print/ that an earlier build made and this one does not are removed, unless
    they were changed since.
    """
    from cmpdesign.design.design import load_design
    from cmpdesign.files.atomic import write_folder
    from cmpdesign.files.earlier_files import LIST_NAME, files_with_lists, find_stale_files, remove_files
    from cmpdesign.layout.build import build_layout
    from cmpdesign.layout.report import design_report

    names = chosen_products(only)
    parameters = load_design(design, parse_overrides(override))
    layout = build_layout(parameters)
    figures = design_report(parameters, layout)
    files, findings = make_products(names, parameters, layout, figures)
    listed = files_with_lists(files, product_folders())
    stale = find_stale_files(output, listed)
    for path in write_folder(output, listed):
        if path.name != LIST_NAME:
            console().print(f"wrote {printable_path(path)}")
    for path in remove_files(stale):
        console().print(f"removed {printable_path(path)}, of an earlier build")
    print_report(figures)
    for finding in (*figures.findings, *findings):
        verb = "will not work" if finding.severity == "error" else "may not work"
        print_warning(f"{verb}: {finding}")


def parse_overrides(texts: list[str] | None) -> dict[str, str]:
    """``--set`` as name -> text; raises ``CmpDesignError`` where a text has no name or no "="."""
    found: dict[str, str] = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise CmpDesignError(f"--set {text}: expected NAME=VALUE, as in pitch_mm=1.5mm")
        found[name.strip()] = value.strip()
    return found


def print_report(figures: DesignReport) -> None:
    from rich.table import Table

    cells = ", ".join(f"{count} {color}" for color, count in figures.cells.items() if count)
    unseen = figures.markers - figures.present_markers
    rows = {
        "pattern": f"{figures.pattern}, {figures.layers} layers, pitch {figures.pitch_mm:.4g} mm",
        "markers": f"{figures.present_markers}" + (f" ({unseen} more ids are never seen)" if unseen else ""),
        "virtual markers": f"{figures.virtual_markers} on {figures.edges} edges ({figures.points} points)",
        "cells": f"{sum(figures.cells.values())}: {cells}",
        "overall size": "{:.2f} x {:.2f} mm, border included".format(*figures.size_mm),
        "smallest feature": f"{figures.smallest_feature_mm:.3f} mm (circle inside the narrowest cell)",
    }
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(name, value)
    console().print(table)
