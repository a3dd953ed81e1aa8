"""Rendering of a pattern, and verdicts on pictures: ``render`` and ``verify`` of the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.inputs.options import Channels, Preset, Response, Usual, Written, settled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.layout.layout import Layout as AnyLayout
    from cmpdesign.products.sheet.verdict import SheetVerdict
    from cmpdesign.reading.problem_report import ProblemReport
    from cmpdesign.reading.verify import Verdict
    from cmpdesign.scene import Rendered, Scene
    from cmpdesign.scene.files.scene_file import SceneFile
    from extractor import Extractor, LayoutLike, Reference

SIZE_PX = (640, 480)


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


def plain_scene(layout: LayoutLike | AnyLayout, seed: int = 0, **view: Unpack[ViewOptions]) -> Scene:
    """A scene of a pattern under one camera, without a scene file.

    Args:
        layout: a layout, the path of a layout file, a ``Reference``, or the JSON object of a layout file.
        seed: seed of the noise.
        view: see ``ViewOptions``.

    Raises:
        SceneError: a value out of range; the message names it.
        TypeError: a name that ``ViewOptions`` does not have.
    """
    from cmpdesign.api.layouts import layout_from
    from cmpdesign.scene import Camera, Optics, Press, Scene, Sensor, composed

    pattern, chosen = layout_from(layout), settled(ViewOptions, view)
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
    name_or_path: str | Path,
    layout: LayoutLike | AnyLayout,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
) -> SceneFile:
    """Load a scene: a scene template's name or a TOML file.

    Args:
        name_or_path: name ("pressed-ball") or path.
        layout: see ``plain_scene``.
        size, seed: (width, height) in px and seed, instead of the file's.

    Raises:
        CmpDesignError: no such scene, or a value that cannot be rendered.
    """
    from cmpdesign.api.layouts import layout_from
    from cmpdesign.design.templates import find_scene
    from cmpdesign.scene.files import scene_file

    return scene_file.load_scene(find_scene(name_or_path), layout_from(layout), size_px=size, seed=seed)


def render(
    layout: LayoutLike | AnyLayout,
    scene: Annotated[str | Path | None, Written(metavar="FILE")] = None,
    *,
    size: Annotated[tuple[int, int] | None, Written(metavar="WxH", most=9999)] = None,
    seed: Annotated[int | None, Written(least=0)] = None,
    **view: Unpack[ViewOptions],
) -> Rendered:
    """Render a pattern as a camera sees the pattern. The picture is seeded, and exact to a thousandth of a pixel.

    >>> rendered = cmpdesign.render(layout, pitch_px=22, rotation_deg=12, tilt_deg=15, noise=2, seed=1)
    >>> rendered.image, rendered.truth.marker_xy_px       # (H, W, 3) uint8 BGR; (M, 2) px
    >>> cmpdesign.render(layout, "pressed-ball").save("pressed.png", truth="pressed.npz")

    Args:
        layout: the pattern's layout.json; or a layout, a ``Reference``, the JSON object of a layout file.
        scene: scene TOML, or the name of a scene template: flat-print, press-and-twist, pressed-ball,
            tac3d-binocular; None: the plain picture of the other options.
        size: width and height in pixels; None: the scene's, or 640x480.
        seed: seed of all random parts; None: the scene's, or 0.
        view: see ``ViewOptions``; only without ``scene``, whose file has these values.

    Raises:
        CmpDesignError: no such scene, or a value that cannot be rendered; a scene that is a sequence, which
            ``render_sequence`` draws; ``view`` beside ``scene``.
    """
    from cmpdesign.scene import render as draw

    if scene is None:
        return draw(plain_scene(layout, seed or 0, **view), size=size or SIZE_PX)
    if view:
        raise CmpDesignError(
            f"{next(iter(view))} cannot be given with a scene; write the value into the scene's file, or give no scene"
        )
    file = load_scene(scene, layout, size, seed)
    if file.fps is not None:
        raise CmpDesignError(f"{scene} is a sequence of {file.frames} frames; draw it with render_sequence")
    return draw(file.scene(), size=file.size_px)


def render_sequence(
    layout: LayoutLike | AnyLayout,
    scene: str | Path,
    output: str | Path,
    truth: str | Path | None = None,
    *,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
) -> dict[str, int]:
    """Draw a scene that is a sequence into a video or a folder of images.

    Args:
        layout: see ``plain_scene``.
        scene: a scene template's name or a TOML file with [sequence].
        output: video (.mp4, .avi, .mkv) or folder to write.
        truth: .npz file for the truth of all frames; None: none.
        size, seed: see ``render``.

    Returns:
        Warnings of doubtful parts, each with the number of its first frame.

    Raises:
        CmpDesignError: see ``render``; or a scene that is no sequence.
        OutputError: a file cannot be written.
    """
    from cmpdesign.scene.files.sequence import write_sequence

    file = load_scene(scene, layout, size, seed)
    if file.fps is None:
        raise CmpDesignError(f"{scene} is one picture, no sequence; draw it with render")
    return write_sequence(file, Path(output), None if truth is None else Path(truth))


@dataclass(frozen=True, eq=False)
class Verifier:
    """Gives verdicts on pictures of one pattern, or of the pads of a family; the reader is made once.

    Attributes:
        layouts: the layout, or the layouts of a family, see ``extractor.Extractor``.
        min_share: share of the visible markers that must be measured, 0 to 1.
        response: relation of light and values, see ``extractor.Extractor``.
        channels: "bgr" or "rgb", the order of a picture's colors.
        sheet_dpi: the pictures are print sheets of this resolution, instead of the files' own; 0: unknown; None:
            pictures that show the code of a print sheet are judged as such.
        max_pixels: largest picture that is read from a file, width x height.
        preset: see ``extractor.Extractor``.
    """

    layouts: Reference | Sequence[Reference]
    min_share: float = 0.9
    response: Response | None = None
    channels: Channels = "bgr"
    sheet_dpi: float | None = None
    max_pixels: int = MAX_PIXELS
    preset: Preset = "balanced"

    @property
    def family(self) -> Sequence[Reference]:
        """The layouts."""
        return self.layouts if isinstance(self.layouts, Sequence) else (self.layouts,)

    @property
    def reference(self) -> Reference:
        """The layout; of a family, the first one."""
        return self.family[0]

    @cached_property
    def extractor(self) -> Extractor:
        """The reader; made for the first picture."""
        from extractor import Extractor

        return Extractor(self.layouts, self.preset, self.response, "either")

    def read(self, image: str | Path | NDArray[Any]) -> NDArray[Any]:
        """The picture as (H, W, 3) BGR.

        Raises:
            ImageFileError: a file or an array that is no color picture.
        """
        from cmpdesign.files.images import read_image, require_color_picture

        if isinstance(image, str | Path):
            pixels: NDArray[Any] = read_image(image, self.max_pixels)
        else:
            pixels = require_color_picture(image)
        return pixels[:, :, ::-1].copy() if self.channels == "rgb" else pixels

    def judge(self, image: NDArray[Any], path: Path | None = None) -> Verdict | SheetVerdict:
        """The verdict on a picture that ``read`` returns; ``path``: the picture's file, which may state the
        resolution.
        """
        from cmpdesign.products.sheet.verdict import judge_sheet
        from cmpdesign.reading.verify import verify as judge_pattern

        sheet = judge_sheet(image, path, [one.digest for one in self.family], self.sheet_dpi)
        if sheet.is_sheet or self.sheet_dpi is not None:
            return sheet
        return judge_pattern(self.extractor, image, self.min_share)

    def verify(self, image: str | Path | NDArray[Any]) -> Verdict | SheetVerdict:
        """Read and judge a picture: a file, or (H, W, 3) uint8 or uint16.

        Raises:
            ImageFileError: a file or an array that is no color picture.
        """
        return self.judge(self.read(image), Path(image) if isinstance(image, str | Path) else None)


class VerifyOptions(TypedDict, total=False):
    """Options of ``verify``: the attributes of ``Verifier``.

    Keys:
        min_share: share of the visible markers that must be measured.
        sheet_dpi: the pictures are print sheets of this resolution (0: unknown); the files' own resolution is ignored.
        preset, response, channels, max_pixels: see ``SequenceOptions``.
    """

    min_share: Annotated[float, Usual(0.9, least=0, most=1)]
    sheet_dpi: Annotated[float | None, Usual(None, least=0)]
    preset: Annotated[Preset, Usual("balanced")]
    response: Annotated[Response | None, Usual(None, metavar="srgb|linear|EXPONENT")]
    channels: Annotated[Channels, Usual("bgr")]
    max_pixels: Annotated[int, Usual(MAX_PIXELS, metavar="COUNT", least=256)]


def verify(
    layout: LayoutLike | AnyLayout | Sequence[LayoutLike | AnyLayout],
    image: str | Path | NDArray[Any],
    *,
    report: str | Path | None = None,
    **options: Unpack[VerifyOptions],
) -> Verdict | SheetVerdict:
    """Extract a picture and check the numbering, the colors, the share of measured markers and the side.

    >>> verdict = cmpdesign.verify("out/layout.json", "out/sample.png")
    >>> verdict.verified, verdict.reason, verdict.markers.xy_px[217]

    For many pictures, ``Verifier(layout.reference()).verify(image)`` makes the reader once.

    Args:
        layout: a layout, the path of a layout file, a ``Reference``, or the JSON object of a layout file; or a list of
            these, a family of pads with different codes: ``verdict.markers.code`` says which pad it is.
        image: a file, or (H, W, 3) uint8 or uint16.
        report: file (.zip) that bundles picture, layout, settings and stages, to send with a picture that is not
            read; None: no file.
        options: see ``VerifyOptions``.

    Returns:
        The verdict; of a picture of a print sheet a ``SheetVerdict`` with the scales and the skew of the print.

    Raises:
        ImageFileError: a file or an array that is no color picture.
        CmpDesignError: ``min_share`` is not from 0 to 1; a report with several layouts.
        extractor.LayoutError: a layout that cannot be read, or layouts that are no family.
        OutputError: the report cannot be written.
    """
    from cmpdesign.api.layouts import reference_from

    layouts = [layout] if isinstance(layout, str) or not isinstance(layout, Sequence) else list(layout)
    verifier = Verifier([reference_from(one) for one in layouts], **options)
    if report is not None and len(layouts) != 1:
        raise CmpDesignError("report: a bundle holds one layout; give the layout of the pad")
    verdict = verifier.verify(image)
    if report is not None:
        _write_report(verifier, _layout_text(layouts[0]), image, verdict, Path(report))
    return verdict


def new_report(verifier: Verifier, layout_text: str) -> ProblemReport:
    """The bundle of pictures, layout and settings, without a picture."""
    from cmpdesign.reading.problem_report import ProblemReport

    settings = {
        "preset": verifier.preset,
        "response": None if verifier.response is None else str(verifier.response),
        "channels": verifier.channels,
        "min_share": verifier.min_share,
    }
    return ProblemReport(layout_text, settings)


def _write_report(
    verifier: Verifier,
    layout_text: str,
    image: str | Path | NDArray[Any],
    verdict: Verdict | SheetVerdict,
    report: Path,
) -> None:
    """Write the bundle of one picture; an array is kept as PNG."""
    from cmpdesign.files.images import to_png
    from cmpdesign.inputs.files import read_file
    from cmpdesign.reading.verify import Verdict
    from extractor.draw import draw_stages

    bundle = new_report(verifier, layout_text)
    if isinstance(image, str | Path):
        name, content = Path(image).name, read_file(image)
    else:
        name, content = "picture.png", to_png(image)
    stages: Mapping[str, NDArray[Any]] = {}
    if isinstance(verdict, Verdict):
        stages = draw_stages(verifier.read(image), verifier.reference, verdict.markers)
    bundle.add(name, content, verdict.to_json(), stages)
    bundle.write(report)


def _layout_text(layout: LayoutLike | AnyLayout) -> str:
    """The text of a layout file as it is, or as a layout is written."""
    if isinstance(layout, str | Path):
        from cmpdesign.inputs.files import read_text

        return read_text(layout)
    from cmpdesign.api.layouts import layout_from

    return layout_from(layout).to_json()
