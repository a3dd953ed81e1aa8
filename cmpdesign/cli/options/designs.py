"""Arguments and options of the commands that take a design."""

from __future__ import annotations

from typing import Annotated

import typer

from cmpdesign.cli.options.pixels import parse_pixels
from cmpdesign.errors import CmpDesignError

CAMERA_TEXT = "640x480"
LARGEST_CAMERA_PX = 99_999


def complete_design(incomplete: str) -> list[str]:
    """The names of templates that begin with a text, for the completion of shells."""
    from cmpdesign.design.templates import templates

    return [name for name in templates() if name.startswith(incomplete)]


def complete_scene(incomplete: str) -> list[str]:
    """The names of scene templates that begin with a text, for the completion of shells."""
    from cmpdesign.design.templates import scene_templates

    return [name for name in scene_templates() if name.startswith(incomplete)]


DesignArgument = Annotated[
    str,
    typer.Argument(
        metavar="DESIGN", help="A template's name or a TOML file.", autocompletion=complete_design
    ),
]

SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Override a parameter, as in pitch_mm=60mil; may be repeated."
    ),
]

CameraOption = Annotated[
    str, typer.Option("--camera", metavar="WxH", help="Pixels of the camera whose picture the pattern fills.")
]


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
