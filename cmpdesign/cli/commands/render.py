"""``cmpdesign render``: renders a pattern or a scene to an image, a video or a folder, with the ground truth."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.api import pictures
from cmpdesign.cli.derived import derived
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.files import require_suffix
from cmpdesign.inputs.options import options_of
from cmpdesign.watch import watched

if TYPE_CHECKING:
    from cmpdesign.scene import Scene
    from cmpdesign.scene.files.scene_file import SceneFile

EXAMPLES = (
    "cmpdesign render layout.json -o sample.png --pitch 22 --tilt 15 --noise 2",
    "cmpdesign render layout.json -o pressed.png --scene pressed-ball --truth pressed.npz",
)
SCENE_FILE_TABLES = {
    "press_mm": "surface.press",
    "press_radius_mm": "surface.press",
    "blur_px": "optics",
    "noise": "sensor",
    "response": "sensor",
}
SCENE_FILE_KEYS = {
    "press_mm": "depth_mm",
    "press_radius_mm": "radius_mm",
}  # the others have the option's name
OutputOption = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        metavar="IMAGE",
        help="Image (.png, .tif, .bmp, .webp, .jpg); of a sequence a video (.mp4, .avi, .mkv) or a folder.",
    ),
]
TruthOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="NPZ file for the markers' true places.")
]


@derived(pictures.render)
def render(
    layout: Path,
    scene: Path | None,
    size: tuple[int, int] | None,
    seed: int | None,
    *,
    ctx: typer.Context,
    output: OutputOption,
    truth: TruthOption = None,
    **view: Any,
) -> None:
    """With a sequence as the scene, a video or a folder of pictures is written."""
    require_suffix("truth", truth, ".npz")
    if scene is not None:
        _refuse_with_scene(ctx)
        file = pictures.load_scene(scene, layout, size, seed)
        if file.fps is not None:
            _render_sequence(file, output, truth)
            return
        _render_picture(file.scene(), file.size_px, output, truth, bits=file.bits, is_of_file=True)
        return
    with _option_names_in_errors():
        plain = pictures.plain_scene(layout, seed or 0, **view)
    _render_picture(plain, size or pictures.SIZE_PX, output, truth)


def _render_picture(
    scene: Scene,
    size_px: tuple[int, int],
    output: Path,
    truth: Path | None,
    *,
    bits: int = 8,
    is_of_file: bool = False,
) -> None:
    """Render a scene of (width, height) pixels; write the image and, if asked for, the truth."""
    import numpy as np

    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import encode_image, require_image_kind
    from cmpdesign.scene import render as render_scene
    from cmpdesign.scene import save_truth

    try:
        require_image_kind(output, bits)
    except CmpDesignError as error:
        raise CmpDesignError(f"{error} (the scene has no [sequence])" if is_of_file else str(error)) from None
    rendered = render_scene(scene, size=size_px)
    print_step("the image is rendered")
    for warning in rendered.warnings:
        print_warning(warning)
    if truth is not None:
        save_truth(rendered.truth, truth)
    write_file(output, encode_image(rendered.image, output))
    visible = tuple(np.atleast_2d(rendered.truth.visible).sum(axis=1).tolist())
    of_views = f" in {len(visible)} views" if rendered.truth.visible.ndim > 1 else ""
    words = f"{size_px[0]} x {size_px[1]} px, {' + '.join(map(str, visible))} markers visible{of_views}"
    _finish(output, truth, words, size_px=size_px, frames=1, fps=None, visible=visible)


def _render_sequence(file: SceneFile, output: Path, truth: Path | None) -> None:
    from cmpdesign.scene.files.sequence import write_sequence

    with working("rendering") as steps, watched(steps.tell):
        warnings = write_sequence(file, output, truth)
    kinds: dict[str, str] = {}  # by letters, without numbers: the first frame of each kind
    for text, frame in warnings.items():
        kind = "".join(letter for letter in text if letter.isalpha())
        kinds.setdefault(kind, f"from frame {frame} ({file.time_s(frame):.3g} s) on: {text}")
    for text in kinds.values():
        print_warning(text)
    words = f"{file.frames} frames of {file.size_px[0]} x {file.size_px[1]} px at {file.fps:g} fps"
    _finish(output, truth, words, size_px=file.size_px, frames=file.frames, fps=file.fps, visible=None)


def _finish(output: Path, truth: Path | None, words: str, **fields: Any) -> None:
    """Print the written files."""
    from cmpdesign.documents.runs import RenderDocument

    if truth is not None:
        say(f"wrote {printable_path(truth)}")
    say(f"wrote {printable_path(output)}: {words}")
    written = tuple(str(path) for path in (truth, output) if path is not None)
    finish(lambda: RenderDocument(written=written, **fields))


def _view_options() -> Mapping[str, str]:
    """Key of a view -> its option."""
    return {one.name: one.usual.name or f"--{one.name}" for one in options_of(pictures.ViewOptions)}


@contextmanager
def _option_names_in_errors() -> Iterator[None]:
    """Within this context, errors of a scene name the option instead of the scene's field."""
    from cmpdesign.scene import SceneError

    try:
        yield
    except SceneError as error:
        text = str(error)
        for name, option in _view_options().items():
            text = re.sub(rf"^{SCENE_FILE_KEYS.get(name, name)}(?= is )", option, text)
        raise CmpDesignError(text) from None


def _refuse_with_scene(ctx: typer.Context) -> None:
    """Check that no option is given that has a key in scene files.

    Raises:
        CmpDesignError: such an option.
    """
    for name, option in sorted(_view_options().items()):
        source = ctx.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            words = "--front or --mirrored" if name == "mirrored" else option
            key = f"[{SCENE_FILE_TABLES.get(name, 'camera')}] {SCENE_FILE_KEYS.get(name, name)}"
            raise CmpDesignError(
                f"{words} cannot be given with {parameter('scene')}; write {key} into the file"
            )
