"""Rendering of a pattern, and verdicts on pictures: ``render`` and ``verify`` of the command line."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

from cmpdesign import documents
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.files import require_suffix
from cmpdesign.inputs.options import Response, Usual, Written, settled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.api.layouts import AnyLayout
    from cmpdesign.scene import Scene
    from cmpdesign.scene.files.scene_file import SceneFile

    OneImage = str | Path | NDArray[Any]

SIZE_PX = (640, 480)
# Where scene files have the properties of a plain picture; the others have the same name in [camera].
SCENE_FILE_TABLES = {
    "press_mm": "surface.press",
    "press_radius_mm": "surface.press",
    "blur_px": "optics",
    "noise": "sensor",
    "response": "sensor",
}
SCENE_FILE_KEYS = {"press_mm": "depth_mm", "press_radius_mm": "radius_mm"}


class ViewOptions(TypedDict, total=False):
    """The properties of a plain picture; the names are the names in scene files.

    Keys:
        pitch_px: pixels from marker to marker.
        rotation_deg: counter-clockwise turn in the image, degrees.
        tilt_deg: tilt out of the image plane, degrees.
        tilt_axis_deg: direction of the tilt's axis, degrees.
        mirrored: side of the pattern that the camera sees: the back or the front; None: as designed.
        press_mm: largest displacement of the markers by a press at the centre, mm.
        press_radius_mm: radius of the press, mm; None: a quarter of the pattern.
        blur_px: Gaussian blur, sigma in pixels.
        noise: noise, standard deviation in 255ths.
        response: response of the camera; with an exponent, light is value ** exponent.
    """

    pitch_px: Annotated[float, Usual(20.0, name="--pitch")]
    rotation_deg: Annotated[float, Usual(0.0, name="--rotation")]
    tilt_deg: Annotated[float, Usual(0.0, name="--tilt")]
    tilt_axis_deg: Annotated[float, Usual(0.0, name="--tilt-axis")]
    mirrored: Annotated[bool | None, Usual(None, name="--mirrored/--front")]
    press_mm: Annotated[float, Usual(0.0, name="--press")]
    press_radius_mm: Annotated[float | None, Usual(None, name="--press-radius")]
    blur_px: Annotated[float, Usual(1.0, name="--blur")]
    noise: Annotated[float, Usual(0.0)]
    response: Annotated[Response, Usual("srgb", metavar="srgb|linear|EXPONENT")]


def plain_scene(layout: AnyLayout, seed: int = 0, **view: Unpack[ViewOptions]) -> Scene:
    """A scene of a pattern under one camera, without a scene file.

    Args:
        layout: a layout, the path of a layout file, a ``Reference``, or the JSON object of a layout file.
        seed: seed of the noise.
        view: see ``ViewOptions``.

    Raises:
        SceneError: a value out of range; the message names it.
        TypeError: a name that ``ViewOptions`` does not have.
    """
    from cmpdesign.api.layouts import read_layout
    from cmpdesign.scene import Camera, Optics, Press, Scene, Sensor, composed

    pattern, chosen = read_layout(layout), settled(ViewOptions, view)
    radius_mm = chosen["press_radius_mm"]
    if radius_mm is None:
        radius_mm = min(pattern.size_mm) / 4
    camera = Camera(
        chosen["pitch_px"],
        chosen["rotation_deg"],
        chosen["tilt_deg"],
        chosen["tilt_axis_deg"],
        mirrored=chosen["mirrored"],
    )
    return Scene(
        layout=pattern,
        camera=camera,
        surface=composed(Press(radius_mm, chosen["press_mm"])) if chosen["press_mm"] else None,
        optics=Optics(chosen["blur_px"]),
        sensor=Sensor(noise=chosen["noise"], response=chosen["response"]),
        seed=seed,
    )


def load_scene(
    name_or_path: str | Path, layout: AnyLayout, size: tuple[int, int] | None = None, seed: int | None = None
) -> SceneFile:
    """Load a scene: a scene template's name or a TOML file.

    Args:
        name_or_path: name ("pressed-ball") or path.
        layout: see ``plain_scene``.
        size, seed: (width, height) in px and seed, instead of the file's.

    Raises:
        CmpDesignError: no such scene, or a value that cannot be rendered.
    """
    from cmpdesign.api.layouts import read_layout
    from cmpdesign.design.templates import find_scene
    from cmpdesign.scene.files import scene_file

    return scene_file.load_scene(find_scene(name_or_path), read_layout(layout), size_px=size, seed=seed)


def render(
    layout: AnyLayout,
    scene: Annotated[str | Path | None, Written(metavar="FILE")] = None,
    output: Annotated[str | Path | None, Written(metavar="IMAGE", needed=True)] = None,
    truth: Annotated[str | Path | None, Written(metavar="FILE")] = None,
    *,
    size: Annotated[tuple[int, int] | None, Written(metavar="WxH", most=9999)] = None,
    seed: Annotated[int | None, Written(least=0)] = None,
    **view: Unpack[ViewOptions],
) -> documents.runs.RenderDocument:
    """Render a pattern as a camera sees the pattern. The picture is seeded, and exact to a thousandth of a pixel.

    >>> rendered = cmpdesign.render(layout, pitch_px=22, rotation_deg=12, tilt_deg=15, noise=2, seed=1)
    >>> rendered.image, rendered.truth.marker_xy_px       # (H, W, 3) uint8 BGR; (M, 2) px
    >>> cmpdesign.render(layout, "pressed-ball", "pressed.png", truth="pressed.npz")
    >>> cmpdesign.render(layout, "press-and-twist", "frames").frames

    Args:
        layout: the pattern's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        scene: scene TOML, or the name of a scene template: flat-print, press-and-twist, pressed-ball,
            tac3d-binocular; None: the plain picture of the other options.
        output: image (.png, .tif, .bmp, .webp, .jpg); of a sequence a video (.mp4, .avi, .mkv) or a folder; None: none,
            of a picture.
        truth: NPZ file for the markers' true places.
        size: width and height in pixels; None: the scene's, or 640x480.
        seed: seed of all random parts; None: the scene's, or 0.
        view: see ``ViewOptions``; only without ``scene``, whose file has these values.

    Returns:
        The record of what is written, with ``image`` and ``truth`` of a picture; ``found`` is its ``Rendered``.

    Raises:
        CmpDesignError: no such scene, or a value that cannot be rendered; an ending of ``output`` that does not suit
            the scene; ``view`` beside ``scene``.
        OutputError: a file cannot be written.
    """
    require_suffix("truth", truth, ".npz")
    if scene is None:
        from cmpdesign.scene import SceneError

        try:
            plain = plain_scene(layout, seed or 0, **view)
        except SceneError as error:
            raise SceneError(_by_parameter(str(error))) from None
        return _render_picture(plain, size or SIZE_PX, output, truth)
    for name in sorted(view):
        key = f"[{SCENE_FILE_TABLES.get(name, 'camera')}] {SCENE_FILE_KEYS.get(name, name)}"
        raise CmpDesignError(
            f"{parameter(name)} cannot be given with {parameter('scene')}; write {key} into the file"
        )
    file = load_scene(scene, layout, size, seed)
    if file.fps is None:
        return _render_picture(file.scene(), file.size_px, output, truth, file)
    if output is None:
        raise CmpDesignError(
            f"{scene} is a sequence of {file.frames} frames; give {parameter('output')}, a video or a folder"
        )
    return _render_sequence(file, Path(output), truth)


def _render_picture(
    scene: Scene,
    size_px: tuple[int, int],
    output: str | Path | None,
    truth: str | Path | None,
    file: SceneFile | None = None,
) -> documents.runs.RenderDocument:
    """Draw a scene, which may be that of a file."""
    import numpy as np

    from cmpdesign.files.images import require_image_kind
    from cmpdesign.scene import render as draw
    from cmpdesign.scene import save_truth

    if output is not None:
        try:
            require_image_kind(Path(output), 8 if file is None else file.bits)
        except CmpDesignError as error:
            raise CmpDesignError(f"{error} (the scene has no [sequence])" if file else str(error)) from None
    rendered = draw(scene, size=size_px)
    if output is not None:
        rendered.save(output, truth)
    elif truth is not None:
        save_truth(rendered.truth, truth)
    visible = np.atleast_2d(rendered.truth.visible).sum(axis=1).tolist()
    written = [str(path) for path in (truth, output) if path is not None]
    return documents.runs.RenderDocument.of(
        rendered, written=written, size_px=size_px, frames=1, fps=None, visible=visible
    )


def _render_sequence(
    file: SceneFile, output: Path, truth: str | Path | None
) -> documents.runs.RenderDocument:
    from cmpdesign.scene.files.sequence import write_sequence

    kinds: dict[str, str] = {}  # by letters, without numbers: the first frame of each kind
    for text, frame in write_sequence(file, output, None if truth is None else Path(truth)).items():
        kind = "".join(letter for letter in text if letter.isalpha())
        kinds.setdefault(kind, f"from frame {frame} ({file.time_s(frame):.3g} s) on: {text}")
    return documents.runs.RenderDocument.of(
        SimpleNamespace(warnings=tuple(kinds.values())),
        written=[str(path) for path in (truth, output) if path is not None],
        size_px=file.size_px,
        frames=file.frames,
        fps=file.fps,
        visible=None,
    )


def _by_parameter(text: str) -> str:
    """The message of an error of a scene, which names the parameter instead of the scene's field."""
    for name in ViewOptions.__annotations__:
        text = re.sub(rf"^{SCENE_FILE_KEYS.get(name, name)}(?= is )", parameter(name), text)
    return text
