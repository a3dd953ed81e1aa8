"""``cmpdesign render``: renders an image of a pattern with its ground truth."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmpdesign.cli.options.designs import complete_scene
from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.options.pixels import parse_pixels
from cmpdesign.cli.options.response import METAVAR, parse_response
from cmpdesign.cli.terminal import finish, print_step, printable_path, say
from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from cmpdesign.scene import Scene

EXAMPLES = (
    "cmpdesign render layout.json -o sample.png --pitch 22 --tilt 15 --noise 2",
    "cmpdesign render layout.json -o pressed.png --scene pressed-ball --truth pressed.npz",
)
LARGEST_SIDE_PX = 9999
SCENES = "flat-print, press-and-twist, pressed-ball, tac3d-binocular"
# Options with a key in a scene file.
SCENE_FILE_KEYS = {
    "pitch": "[camera] pitch_px",
    "rotation": "[camera] rotation_deg",
    "tilt": "[camera] tilt_deg",
    "tilt_axis": "[camera] tilt_axis_deg",
    "mirrored": "[camera] mirrored",
    "press": "[surface.press] depth_mm",
    "press_radius": "[surface.press] radius_mm",
    "blur": "[optics] blur_px",
    "noise": "[sensor] noise",
    "response": "[sensor] response",
}


def require_finite(option: typer.CallbackParam, value: float | None) -> float | None:
    """Check that the value of an option is finite: the parser accepts "nan" and "inf".

    Raises:
        CmpDesignError: a value that is not finite.
    """
    if value is not None and not math.isfinite(value):
        raise CmpDesignError(f"{option.opts[0]} is {value}; expected a finite number")
    return value


def render(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
    ctx: typer.Context,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="IMAGE",
            help="Image (.png, .tif, .bmp, .webp, .jpg); of a sequence a video (.mp4, .avi, .mkv) or a folder.",
        ),
    ],
    scene: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help=f"Scene TOML, or the name of a scene template: {SCENES}.",
            autocompletion=complete_scene,
        ),
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="NPZ file for the markers' true places.")
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Image size in pixels.")] = "640x480",
    pitch: Annotated[
        float, typer.Option(callback=require_finite, help="Pixels from marker to marker.")
    ] = 20.0,
    rotation: Annotated[
        float, typer.Option(callback=require_finite, help="Counter-clockwise turn in the image, degrees.")
    ] = 0.0,
    tilt: Annotated[
        float, typer.Option(callback=require_finite, help="Tilt out of the image plane, degrees.")
    ] = 0.0,
    tilt_axis: Annotated[
        float, typer.Option(callback=require_finite, help="Direction of the tilt's axis, degrees.")
    ] = 0.0,
    mirrored: Annotated[
        bool | None,
        typer.Option(
            "--mirrored/--front",
            help="Side of the pattern that the camera sees: the back or the front. [default: as designed]",
        ),
    ] = None,
    press: Annotated[
        float,
        typer.Option(
            callback=require_finite, help="Largest displacement of the markers by a press at the centre, mm."
        ),
    ] = 0.0,
    press_radius: Annotated[
        float | None,
        typer.Option(
            callback=require_finite, help="Radius of the press, mm. [default: a quarter of the pattern]"
        ),
    ] = None,
    blur: Annotated[
        float, typer.Option(callback=require_finite, help="Gaussian blur, sigma in pixels.")
    ] = 1.0,
    noise: Annotated[
        float, typer.Option(callback=require_finite, help="Noise, standard deviation in 255ths.")
    ] = 0.0,
    response: Annotated[
        str,
        typer.Option(
            metavar=METAVAR,
            help="Response of the camera; with an exponent, light is value ** exponent.",
        ),
    ] = "srgb",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
) -> None:
    """Render a pattern as a camera sees the pattern. The picture is seeded, and exact to a thousandth of a pixel."""
    if scene is not None:
        from cmpdesign.cli.commands.render_scene import render_scene_file

        given = _given_options(ctx)
        pixels = parse_pixels("--size", size, LARGEST_SIDE_PX) if "size" in given else None
        render_scene_file(layout, scene, output, truth, pixels, seed if "seed" in given else None)
        return
    from cmpdesign.api.pictures import plain_scene
    from cmpdesign.files.images import require_image_kind

    pixels = parse_pixels("--size", size, LARGEST_SIDE_PX)
    require_image_kind(output, 8)
    require_suffix("--truth", truth, [".npz"])
    with _option_names_in_errors():
        pattern_scene = plain_scene(
            layout,
            seed,
            pitch_px=pitch,
            rotation_deg=rotation,
            tilt_deg=tilt,
            tilt_axis_deg=tilt_axis,
            mirrored=mirrored,
            press_mm=press,
            press_radius_mm=press_radius,
            blur_px=blur,
            noise=noise,
            response=parse_response(response),
        )
    _write_rendered(pattern_scene, pixels, output, truth)


@contextmanager
def _option_names_in_errors() -> Iterator[None]:
    """Within this context, errors of a scene name the option instead of the scene's field."""
    from cmpdesign.scene import SceneError

    try:
        yield
    except SceneError as error:
        text = str(error)
        for name, key in SCENE_FILE_KEYS.items():
            option, field = f"--{name.replace('_', '-')}", key.rpartition(" ")[2]
            text = re.sub(rf"^{field}(?= is )", option, text)
        raise CmpDesignError(text) from None


def _write_rendered(scene: Scene, pixels: tuple[int, int], output: Path, truth: Path | None) -> None:
    """Render a scene of (width, height) pixels; write the image and, if asked for, the truth."""
    from cmpdesign.documents.runs import RenderDocument
    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import encode_image
    from cmpdesign.scene import render as render_scene
    from cmpdesign.scene import save_truth

    rendered = render_scene(scene, size=pixels)
    print_step("the image is rendered")
    if truth is not None:
        save_truth(rendered.truth, truth)
        say(f"wrote {printable_path(truth)}")
    write_file(output, encode_image(rendered.image, output))
    visible = int(rendered.truth.visible.sum())
    say(f"wrote {printable_path(output)}: {pixels[0]} x {pixels[1]} px, {visible} markers visible")
    finish(
        lambda: RenderDocument(
            written=tuple(printable_path(path) for path in (truth, output) if path is not None),
            size_px=pixels,
            frames=1,
            fps=None,
            visible=(visible,),
        )
    )


def _given_options(ctx: typer.Context) -> set[str]:
    """The names of the options on the command line, for use with a scene file.

    Raises:
        CmpDesignError: an option with a key in scene files.
    """
    sources = {name: ctx.get_parameter_source(name) for name in ctx.params}
    given = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    for name in sorted(given & SCENE_FILE_KEYS.keys()):
        option = "--front or --mirrored" if name == "mirrored" else f"--{name.replace('_', '-')}"
        raise CmpDesignError(
            f"{option} cannot be given with --scene; write {SCENE_FILE_KEYS[name]} into the file"
        )
    return given
