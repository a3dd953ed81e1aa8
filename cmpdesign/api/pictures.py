"""Rendering of a pattern, and verdicts on pictures: ``render`` and ``verify`` of the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypedDict, Unpack

from cmpdesign.errors import CmpDesignError, InputError, parameter
from cmpdesign.files.atomic import write_file
from cmpdesign.inputs.files import MAX_PIXELS, require_suffix
from cmpdesign.inputs.options import Channels, Preset, Response, Usual, Written, settled
from cmpdesign.inputs.texts import one_line, visible
from cmpdesign.watch import tell, told

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.documents.reading import VerifyDocument
    from cmpdesign.documents.runs import RenderDocument
    from cmpdesign.layout.layout import Layout as AnyLayout
    from cmpdesign.products.sheet.verdict import SheetVerdict
    from cmpdesign.reading.problem_report import ProblemReport
    from cmpdesign.reading.verify import Verdict
    from cmpdesign.scene import Scene
    from cmpdesign.scene.files.scene_file import SceneFile
    from cmpdesign.tracking.source_images import SourceImage
    from extractor import Extractor, LayoutLike, Reference

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
    output: Annotated[str | Path | None, Written(metavar="IMAGE", needed=True)] = None,
    truth: Annotated[str | Path | None, Written(metavar="FILE")] = None,
    *,
    size: Annotated[tuple[int, int] | None, Written(metavar="WxH", most=9999)] = None,
    seed: Annotated[int | None, Written(least=0)] = None,
    **view: Unpack[ViewOptions],
) -> RenderDocument:
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
        with _scene_errors_name_parameters():
            plain = plain_scene(layout, seed or 0, **view)
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
) -> RenderDocument:
    """Draw a scene, which may be that of a file."""
    import numpy as np

    from cmpdesign.documents.runs import RenderDocument
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
    return RenderDocument.of(rendered, written=written, size_px=size_px, frames=1, fps=None, visible=visible)


class RenderedSequence(NamedTuple):
    """What a sequence leaves beside its files: warnings, one of each kind."""

    warnings: tuple[str, ...]


def _render_sequence(file: SceneFile, output: Path, truth: str | Path | None) -> RenderDocument:
    from cmpdesign.documents.runs import RenderDocument
    from cmpdesign.scene.files.sequence import write_sequence

    kinds: dict[str, str] = {}  # by letters, without numbers: the first frame of each kind
    for text, frame in write_sequence(file, output, None if truth is None else Path(truth)).items():
        kind = "".join(letter for letter in text if letter.isalpha())
        kinds.setdefault(kind, f"from frame {frame} ({file.time_s(frame):.3g} s) on: {text}")
    return RenderDocument.of(
        RenderedSequence(tuple(kinds.values())),
        written=[str(path) for path in (truth, output) if path is not None],
        size_px=file.size_px,
        frames=file.frames,
        fps=file.fps,
        visible=None,
    )


@contextmanager
def _scene_errors_name_parameters() -> Iterator[None]:
    """Within this context, errors of a scene name the parameter instead of the scene's field."""
    from cmpdesign.scene import SceneError

    try:
        yield
    except SceneError as error:
        text = str(error)
        for name in ViewOptions.__annotations__:
            text = re.sub(rf"^{SCENE_FILE_KEYS.get(name, name)}(?= is )", parameter(name), text)
        raise SceneError(text) from None


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
    images: OneImage | Sequence[OneImage | int],
    output: Annotated[str | Path | None, Written(metavar="FOLDER")] = None,
    *,
    debug: str | Path | None = None,
    report: Annotated[str | Path | None, Written(metavar="FILE")] = None,
    frames: Annotated[int | None, Written(least=1)] = None,
    bits: Annotated[int | None, Written(least=8, most=16)] = None,
    on_verdict: Callable[[str, Verdict | SheetVerdict], None] = lambda name, verdict: None,
    **options: Unpack[VerifyOptions],
) -> VerifyDocument:
    """Extract a picture and check the numbering, the colors, the share of measured markers and the side.

    >>> verdict = cmpdesign.verify("out/layout.json", "out/sample.png")
    >>> verdict.verified, verdict.images[0].reason, verdict.found.markers.xy_px[217]

    For verdicts without files, ``Verifier(layout.reference()).verify(image)`` makes the reader once.

    Args:
        layout: a layout, the path of a layout file, a ``Reference``, or the JSON object of a layout file; or a list of
            these, a family of pads with different codes: ``markers.code`` says which pad a picture shows.
        images: a picture: a file, or (H, W, 3) uint8 or uint16; or several pictures, folders, patterns such as
            "run*/*.png", videos, numbers of cameras, streams.
        output: folder for overlay pictures and verify.json.
        debug: folder for a picture of every stage.
        report: bundle for a report of a problem, .zip: the pictures as they are, EXIF included, the layout, settings,
            versions and the stages.
        frames: read this many frames of each video, camera or stream; None: all of a video, one of a camera or stream.
        bits: bits of the camera's values in pictures of 16 bits; None: found from the values.
        on_verdict: called with the name of every picture and its ``Verdict``, or the ``SheetVerdict`` of a print sheet.
        options: see ``VerifyOptions``.

    Returns:
        The verdicts; ``found`` is the ``Verdict`` or ``SheetVerdict`` of one picture that is not given in a list.

    Raises:
        ImageFileError: one picture that cannot be read; of several, the document says why.
        CmpDesignError: ``min_share`` is not from 0 to 1; a report with several layouts; no such source.
        extractor.LayoutError: a layout that cannot be read, or layouts that are no family.
        OutputError: a file cannot be written.
    """
    from cmpdesign.api.layouts import reference_from
    from cmpdesign.files.images import ImageFileError
    from extractor.layout.layout_file import layouts_of

    require_suffix("report", report, ".zip")
    layouts = [layout] if isinstance(layout, str) or not isinstance(layout, Sequence) else list(layout)
    if report is not None and len(layouts) > 1:
        raise InputError(
            f"{parameter('report')} bundles one layout, and {len(layouts)} are given; give the pad's"
        )
    judge = Verifier(layouts_of([reference_from(one) for one in layouts]), **options)
    bundle = None if report is None else _new_report(judge, _layout_text(layouts[0]))
    files = _Files(
        judge, None if output is None else Path(output), None if debug is None else Path(debug), bundle
    )
    is_one = isinstance(images, str) or not isinstance(images, Sequence)
    given: Sequence[Any] = [images] if is_one else list(images)  # type: ignore[arg-type]
    verdict, parts = None, []
    for source in _source_images(judge, given, frames, bits):
        name = visible(source.name)
        if source.image is None:
            if is_one:
                raise ImageFileError(source.problem)
            unread = {"verified": False, "error": one_line(source.problem)}
            files.add_unread(source, unread)
            parts.append({"image": name, **unread})
            continue
        image = judge.read(source.image)
        verdict = judge.judge(image, source.path)
        files.add(image, source, verdict)
        on_verdict(name, verdict)
        parts.append({"image": name, **verdict.to_json()})
    document = _verify_document(judge, parts, verdict if is_one else None)
    if output is not None:
        write_file(Path(output) / "verify.json", document.to_json())
    if report is not None and bundle is not None:
        bundle.write(Path(report))
    return document


def _source_images(
    judge: Verifier, images: Sequence[Any], frames: int | None, bits: int | None
) -> Iterator[SourceImage]:
    """The pictures of sources, or arrays; the number of pictures that are done is told."""
    from cmpdesign.files.images import require_color_picture
    from cmpdesign.inputs.sources import name_sources
    from cmpdesign.tracking.source_images import SourceImage, count_images, source_images
    from cmpdesign.tracking.sources import Reading

    if all(isinstance(image, str | Path | int) for image in images):
        sources = name_sources(map(str, images))
        total = count_images(sources, frames)
        found = source_images(sources, frames, Reading(max_pixels=judge.max_pixels, bits=bits))
        yield from found if total is None else told(found, total, "pictures")
        return
    for number, image in enumerate(images, start=1):
        name = f"picture-{number}"
        yield SourceImage(name, name, require_color_picture(image), "", None)
        tell(number, len(images), "pictures")


@dataclass(frozen=True)
class _Files:
    """What ``verify`` writes for each picture.

    Attributes:
        output, debug: folders for overlays and for pictures of stages.
        bundle: the report of a problem.
    """

    judge: Verifier
    output: Path | None
    debug: Path | None
    bundle: ProblemReport | None

    def add_unread(self, source: SourceImage, verdict: Mapping[str, Any]) -> None:
        """Put the file of an image that cannot be read into the report, if there is a file."""
        if self.bundle is not None and source.path is not None:
            with suppress(InputError):
                self.bundle.add(*source.picture(), verdict, {})

    def add(self, image: NDArray[Any], source: SourceImage, verdict: Verdict | SheetVerdict) -> None:
        """Write the pictures of a pattern, and add the image to the report."""
        from cmpdesign.files.images import to_png
        from cmpdesign.reading.verify import Verdict
        from extractor.draw import draw_markers, draw_stages

        stages: Mapping[str, NDArray[Any]] = {}
        if isinstance(verdict, Verdict):
            reference = self.judge.extractor.layout_of(verdict.markers)
            if self.output is not None:
                overlay = to_png(draw_markers(image, reference, verdict.markers))
                write_file(self.output / f"{source.stem}.overlay.png", overlay)
            if self.debug is not None or self.bundle is not None:
                stages = draw_stages(image, reference, verdict.markers)
        if self.debug is not None:
            for number, (stage, picture) in enumerate(stages.items(), start=1):
                write_file(self.debug / f"{source.stem}.{number}-{stage}.png", to_png(picture))
        if self.bundle is not None:
            self.bundle.add(*source.picture(), verdict.to_json(), stages)


def _verify_document(judge: Verifier, images: Sequence[Mapping[str, Any]], found: object) -> VerifyDocument:
    from cmpdesign.documents.reading import VerifyDocument

    codes = [one.code.id for one in judge.family if one.code is not None]
    return VerifyDocument.of(
        found,
        format="cmp-verification",
        version=1,
        pattern=judge.reference.pattern,
        digest=judge.reference.digest,
        min_share=judge.min_share,
        verified=all(image["verified"] for image in images),
        images=images,
        **({"codes": codes} if len(judge.family) > 1 else {}),
    )


def _new_report(judge: Verifier, layout_text: str) -> ProblemReport:
    """The bundle of pictures, layout and settings, without a picture."""
    from cmpdesign.reading.problem_report import ProblemReport

    settings = {
        "preset": judge.preset,
        "response": None if judge.response is None else str(judge.response),
        "channels": judge.channels,
        "min_share": judge.min_share,
    }
    return ProblemReport(layout_text, settings)


def _layout_text(layout: LayoutLike | AnyLayout) -> str:
    """The text of a layout file as it is, or as a layout is written."""
    if isinstance(layout, str | Path):
        from cmpdesign.inputs.files import read_text

        return read_text(layout)
    from cmpdesign.api.layouts import layout_from

    return layout_from(layout).to_json()
