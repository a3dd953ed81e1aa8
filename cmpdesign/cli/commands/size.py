"""``cmpdesign size``: a design for a camera and its field of view."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer

from cmpdesign.cli.terminal import finish, printable_path, say, say_table, say_text
from cmpdesign.inputs.files import require_suffix

EXAMPLES = (
    "cmpdesign size --camera 1280x960 --view 24x18mm",
    "cmpdesign size --camera 640x480 --view 20x15mm --make mold -o sized.toml",
)


def size(
    camera: Annotated[str, typer.Option(metavar="WxH", help="Pixels of the camera, as in 1280x960.")],
    view: Annotated[
        str, typer.Option(metavar="WxH", help="Field of view in the pattern's plane, as in 24x18mm.")
    ],
    make: Annotated[
        Literal["laser", "mold", "print"] | None,
        typer.Option(help="How the pad is made: the design is one that build accepts. [default: any way]"),
    ] = None,
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
) -> None:
    """Propose pitch and layers for a camera and its field of view, with the markers' predicted error."""
    from cmpdesign.documents.designs import SizeDocument
    from cmpdesign.files.atomic import write_file
    from cmpdesign.proposal import camera_design

    require_suffix("output", output, ".toml")
    proposal = camera_design.size(camera, view, error, blur_px=blur, noise=noise, make=make)
    if output is not None:
        write_file(output, proposal.to_toml())
    say_table(proposal.figures())
    if output is not None:
        say(f"wrote {printable_path(output)}")
        say_text(f"next: {proposal.next_command(shlex.quote(str(output)))}\n")
    else:
        say_text("\n" + proposal.to_toml() + "\n# next: the same with -o sized.toml\n")
    finish(lambda: SizeDocument.model_validate(proposal.to_json()))
