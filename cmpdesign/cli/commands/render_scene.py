"""``cmpdesign render --scene``: renders a scene file to an image, or to a video or folder with the truth per frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cmpdesign.cli.options.paths import require_suffix
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import finish, print_step, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError
from cmpdesign.watch import watched

if TYPE_CHECKING:
    from cmpdesign.scene.files.scene_file import SceneFile
    from cmpdesign.scene.truth import Truth


def render_scene_file(
    layout: Path,
    scene: Path,
    output: Path,
    truth: Path | None,
    size: tuple[int, int] | None,
    seed: int | None,
) -> None:
    """Render a scene file.

    Args:
        layout: the layout file.
        scene: the scene file, or the name of a scene template.
        output: image, video or folder to write.
        truth: file for the ground truth, if any.
        size: (width, height) in px in place of the file's, if any.
        seed: seed in place of the file's, if any.

    Raises:
        CmpDesignError: a value that cannot be rendered, or a suffix that does not suit the scene.
    """
    from cmpdesign.design.templates import find_scene
    from cmpdesign.reading.read_layout import read_layout
    from cmpdesign.scene.files.scene_file import load_scene

    require_suffix("--truth", truth, [".npz"])
    file = load_scene(find_scene(scene), read_layout(layout), size_px=size, seed=seed)
    if file.fps is None:
        _render_image(file, output, truth)
    else:
        _render_sequence(file, output, truth)


def _render_image(file: SceneFile, output: Path, truth: Path | None) -> None:
    import numpy as np

    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import encode_image, require_image_kind
    from cmpdesign.scene import render, save_truth

    try:
        require_image_kind(output, file.bits)
    except CmpDesignError as error:
        raise CmpDesignError(f"{error} (the scene has no [sequence])") from None
    rendered = render(file.scene(), size=file.size_px)
    print_step("the image is rendered")
    for warning in rendered.warnings:
        print_warning(warning)
    if truth is not None:
        save_truth(rendered.truth, truth)
    write_file(output, encode_image(rendered.image, output))
    visible = np.atleast_2d(rendered.truth.visible).sum(axis=1).tolist()
    _finish(
        file, output, truth, f"{_format_size(file)}, {_format_visible_count(rendered.truth)}", tuple(visible)
    )


def _finish(
    file: SceneFile, output: Path, truth: Path | None, words: str, visible: tuple[int, ...] | None
) -> None:
    """Print the written files."""
    from cmpdesign.documents.runs import RenderDocument

    if truth is not None:
        say(f"wrote {printable_path(truth)}")
    say(f"wrote {printable_path(output)}: {words}")
    finish(
        lambda: RenderDocument(
            written=tuple(printable_path(path) for path in (truth, output) if path is not None),
            size_px=file.size_px,
            frames=1 if file.fps is None else file.frames,
            fps=file.fps,
            visible=visible,
        )
    )


def _render_sequence(file: SceneFile, output: Path, truth: Path | None) -> None:
    from cmpdesign.scene.files.sequence import write_sequence

    with working("rendering") as steps, watched(steps.tell):
        warnings = write_sequence(file, output, truth)
    _print_scene_warnings(warnings, file)
    _finish(file, output, truth, f"{file.frames} frames of {_format_size(file)} at {file.fps:g} fps", None)


def _print_scene_warnings(warnings: dict[str, int], file: SceneFile) -> None:
    """Print each kind of warning with its first frame; kinds are compared by letters, without numbers."""
    kinds: dict[str, str] = {}
    for text, frame in warnings.items():
        kind = "".join(letter for letter in text if letter.isalpha())
        kinds.setdefault(kind, f"from frame {frame} ({file.time_s(frame):.3g} s) on: {text}")
    for text in kinds.values():
        print_warning(text)


def _format_size(file: SceneFile) -> str:
    return f"{file.size_px[0]} x {file.size_px[1]} px"


def _format_visible_count(truth: Truth) -> str:
    if truth.visible.ndim == 1:
        return f"{truth.visible.sum()} markers visible"
    return f"{' + '.join(str(n) for n in truth.visible.sum(axis=1))} markers visible in {len(truth.visible)} views"
