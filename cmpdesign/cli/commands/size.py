"""``cmpdesign size``: a design for a camera and its field of view."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.paths import require_suffix
from cmpdesign.cli.terminal import console, print_document, printable_path


def size(
    camera: Annotated[str, typer.Option(metavar="WxH", help="Pixels of the camera, as in 1280x960.")],
    view: Annotated[
        str, typer.Option(metavar="WxH", help="What it sees of the pattern's plane, as in 24x18mm.")
    ],
    error: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="Largest error per marker and axis, as in 0.2um. [default: none]"
        ),
    ] = None,
    blur: Annotated[float, typer.Option(help="Blur of optics and pixel, sigma in pixels.")] = 1.0,
    noise: Annotated[float, typer.Option(help="Noise, standard deviation in 255ths.")] = 2.0,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="TOML file to write, which build takes."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON instead.")] = False,
) -> None:
    """Which pitch and how many layers for a camera and its field of view, with the error that markers then have."""
    from cmpdesign.files.atomic import write_file
    from cmpdesign.proposal import camera_design

    require_suffix("--output", output, [".toml"])
    proposal = camera_design.size(camera, view, error, blur_px=blur, noise=noise)
    if output is not None:
        write_file(output, proposal.to_toml())
    if as_json:
        print_document(json.dumps(proposal.to_json(), indent=2, ensure_ascii=False) + "\n")
        return
    from rich.table import Table

    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in proposal.figures().items():
        table.add_row(name, value)
    console().print(table)
    if output is not None:
        console().print(f"wrote {printable_path(output)}")
    else:
        print_document("\n" + proposal.to_toml())
