"""``cmpdesign render``: a picture of a pattern with its ground truth."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from cmpdesign.cli.terminal import console, printable
from cmpdesign.errors import CmpDesignError


def render(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="IMAGE", help="PNG file to write.")],
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="NPZ file for the markers' true places.")
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Image size in pixels.")] = "640x480",
    pitch: Annotated[float, typer.Option(help="Pixels from marker to marker.")] = 20.0,
    rotation: Annotated[float, typer.Option(help="Counter-clockwise turn in the image, degrees.")] = 0.0,
    tilt: Annotated[float, typer.Option(help="Tilt out of the image plane, degrees.")] = 0.0,
    tilt_axis: Annotated[float, typer.Option(help="Direction of the tilt's axis, degrees.")] = 0.0,
    mirrored: Annotated[
        bool | None,
        typer.Option("--mirrored/--front", help="See the back or the front. [default: as designed]"),
    ] = None,
    press: Annotated[float, typer.Option(help="How far a press at the centre moves the markers, mm.")] = 0.0,
    press_radius: Annotated[
        float | None, typer.Option(help="Radius of the press, mm. [default: a quarter of the pattern]")
    ] = None,
    blur: Annotated[float, typer.Option(help="Gaussian blur, sigma in pixels.")] = 1.0,
    noise: Annotated[float, typer.Option(help="Noise, standard deviation in 255ths.")] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
) -> None:
    """Render the pattern as a camera sees it: seeded, exact to a thousandth of a pixel."""
    from cmpdesign.reading import read_layout
    from cmpdesign.scene import Camera, Optics, Press, Scene, Sensor, Surface
    from cmpdesign.scene import render as render_scene

    width, height = image_size(size)
    pattern = read_layout(layout)
    radius = min(pattern.size_mm) / 4 if press_radius is None else press_radius
    scene = Scene(
        layout=pattern,
        size_px=(width, height),
        camera=Camera(pitch, rotation, tilt, tilt_axis, mirrored=mirrored),
        surface=Surface((Press(radius, press),)) if press else None,
        optics=Optics(blur),
        sensor=Sensor(noise=noise),
        seed=seed,
    )
    image, true_places = render_scene(scene)


def image_size(text: str) -> tuple[int, int]:
    """Width and height from "640x480"; raises ``CmpDesignError``."""
    match = re.fullmatch(r"([1-9]\d{1,4})x([1-9]\d{1,4})", text)
    if not match:
        raise CmpDesignError(f"--size {text}: expected WIDTHxHEIGHT in pixels, as in 640x480")
    return int(match[1]), int(match[2])
