"""``cmpdesign build``: a design's files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.terminal import console, print_warning, printable
from cmpdesign.errors import CmpDesignError
from cmpdesign.products.registry import PRODUCTS, USUAL, chosen_products, make_products, product_folders

if TYPE_CHECKING:
    from cmpdesign.layout.report import Report

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
    ] = USUAL,
) -> None:
    """Write a design's files: SVG, layout file, preview and report, or what --only names.

    Files in laser/, mold/, mesh/ and print/ that an earlier build made and this one does not are removed, unless
    they were changed since.
    """
    from cmpdesign.design.design import load_design
    from cmpdesign.files.atomic import write_folder
    from cmpdesign.files.earlier_files import LIST_NAME, remove, stale_files, with_lists
    from cmpdesign.layout.build import build_layout
    from cmpdesign.layout.report import report

    names = chosen_products(only)
    parameters = load_design(design, overrides(override))
    layout = build_layout(parameters)
    figures = report(parameters, layout)
    files, findings = make_products(names, parameters, layout, figures)
    listed = with_lists(files, product_folders())
    stale = stale_files(output, listed)
    for path in write_folder(output, listed):
        if path.name != LIST_NAME:
            console().print(f"wrote {printable(path)}")
    for path in remove(stale):
        console().print(f"removed {printable(path)}, of an earlier build")
    print_figures(figures)
    for finding in (*figures.findings, *findings):
        verb = "will not work" if finding.severity == "error" else "may not work"
        print_warning(f"{verb}: {finding}")


def overrides(texts: list[str] | None) -> dict[str, str]:
    """``--set`` as name -> text; raises ``CmpDesignError`` where a text has no name or no "="."""
    found: dict[str, str] = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise CmpDesignError(f"--set {text}: expected NAME=VALUE, as in pitch_mm=1.5mm")
        found[name.strip()] = value.strip()
    return found


def print_figures(figures: Report) -> None:
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
