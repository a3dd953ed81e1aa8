"""Verdicts on pictures: ``verify`` of the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

from cmpdesign import documents
from cmpdesign.errors import InputError, parameter
from cmpdesign.files.atomic import write_file
from cmpdesign.inputs.files import MAX_PIXELS, require_suffix
from cmpdesign.inputs.options import Channels, Preset, Response, Usual, Written, settled
from cmpdesign.inputs.texts import one_line, visible
from cmpdesign.watch import notice, tell, told

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.api.layouts import AnyLayout
    from cmpdesign.products.sheet.verdict import SheetVerdict
    from cmpdesign.reading.problem_report import ProblemReport
    from cmpdesign.reading.verify import Verdict
    from cmpdesign.tracking.source_images import SourceImage
    from extractor import Extractor, Reference

    OneImage = str | Path | NDArray[Any]


class VerifyOptions(TypedDict, total=False):
    """Options of ``verify`` and ``Verifier``.

    Keys:
        min_share: share of the visible markers that must be measured.
        sheet_dpi: the pictures are print sheets of this resolution (0: unknown); the files' own resolution is ignored;
            None: pictures that show the code of a print sheet are judged as such.
        preset, response, channels, max_pixels: see ``SequenceOptions``.
    """

    min_share: Annotated[float, Usual(0.9, least=0, most=1)]
    sheet_dpi: Annotated[float | None, Usual(None, least=0)]
    preset: Annotated[Preset, Usual("balanced")]
    response: Annotated[Response | None, Usual(None, metavar="srgb|linear|EXPONENT")]
    channels: Annotated[Channels, Usual("bgr")]
    max_pixels: Annotated[int, Usual(MAX_PIXELS, metavar="COUNT", least=256)]


class Verifier:
    """Gives verdicts on pictures of one pattern, or of the pads of a family; the reader is made once.

    Attributes:
        family: the layouts, see ``extractor.Extractor``.
        options: all options, see ``VerifyOptions``.
    """

    def __init__(self, layouts: Reference | Sequence[Reference], **options: Unpack[VerifyOptions]) -> None:
        self.family = tuple(layouts) if isinstance(layouts, Sequence) else (layouts,)
        self.options = settled(VerifyOptions, options)

    @property
    def reference(self) -> Reference:
        """The layout; of a family, the first one."""
        return self.family[0]

    @cached_property
    def extractor(self) -> Extractor:
        """The reader; made for the first picture."""
        from extractor import Extractor

        return Extractor(self.family, self.options["preset"], self.options["response"], "either")

    def read(self, image: str | Path | NDArray[Any]) -> NDArray[Any]:
        """The picture as (H, W, 3) BGR.

        Raises:
            ImageFileError: a file or an array that is no color picture.
        """
        from cmpdesign.files.images import read_image, require_color_picture

        if isinstance(image, str | Path):
            pixels: NDArray[Any] = read_image(image, self.options["max_pixels"])
        else:
            pixels = require_color_picture(image)
        return pixels[:, :, ::-1].copy() if self.options["channels"] == "rgb" else pixels

    def judge(self, image: NDArray[Any], path: Path | None = None) -> Verdict | SheetVerdict:
        """The verdict on a picture that ``read`` returns; ``path``: the picture's file, which may state the
        resolution.
        """
        from cmpdesign.products.sheet.verdict import judge_sheet
        from cmpdesign.reading.verify import verify as judge_pattern

        dpi = self.options["sheet_dpi"]
        sheet = judge_sheet(image, path, [one.digest for one in self.family], dpi)
        if sheet.is_sheet or dpi is not None:
            return sheet
        return judge_pattern(self.extractor, image, self.options["min_share"])

    def verify(self, image: str | Path | NDArray[Any]) -> Verdict | SheetVerdict:
        """Read and judge a picture: a file, or (H, W, 3) uint8 or uint16.

        Raises:
            ImageFileError: a file or an array that is no color picture.
        """
        return self.judge(self.read(image), Path(image) if isinstance(image, str | Path) else None)


def verify(
    layout: AnyLayout | Sequence[AnyLayout],
    images: OneImage | Sequence[OneImage | int],
    output: Annotated[str | Path | None, Written(metavar="FOLDER")] = None,
    *,
    debug: str | Path | None = None,
    report: Annotated[str | Path | None, Written(metavar="FILE")] = None,
    frames: Annotated[int | None, Written(least=1)] = None,
    bits: Annotated[int | None, Written(least=8, most=16)] = None,
    on_verdict: Callable[[str, Verdict | SheetVerdict], None] = lambda name, verdict: None,
    **options: Unpack[VerifyOptions],
) -> documents.reading.VerifyDocument:
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
    files = _Files(judge, output, debug, bundle)
    is_one, verdict, parts = isinstance(images, str) or not isinstance(images, Sequence), None, []
    for source in _source_images(judge, [images] if is_one else images, frames, bits):
        if source.image is None and is_one:
            raise ImageFileError(source.problem)
        verdict = files.judged(source)
        if verdict is not None:
            on_verdict(visible(source.name), verdict)
            notice(f"{visible(source.name)}: {verdict.line()}")
        found = _unread(source) if verdict is None else verdict.to_json()
        parts.append({"image": visible(source.name), **found})
    document = _document(judge, parts, verdict if is_one and len(parts) == 1 else None)
    if output is not None:
        write_file(Path(output) / "verify.json", document.to_json())
    if report is not None and bundle is not None:
        bundle.write(Path(report))
    return document


def _source_images(
    judge: Verifier, images: Any, frames: int | None, bits: int | None
) -> Iterator[SourceImage]:
    """The pictures of sources, or arrays; the number of pictures that are done is told."""
    from cmpdesign.files.images import require_color_picture
    from cmpdesign.inputs.sources import name_sources
    from cmpdesign.tracking.source_images import SourceImage, count_images, source_images
    from cmpdesign.tracking.sources import Reading

    if all(isinstance(image, str | Path | int) for image in images):
        sources = name_sources(map(str, images))
        total = count_images(sources, frames)
        found = source_images(sources, frames, Reading(max_pixels=judge.options["max_pixels"], bits=bits))
        yield from found if total is None else told(found, total, "pictures")
        return
    for number, image in enumerate(images, start=1):
        name = f"picture-{number}"
        yield SourceImage(name, name, require_color_picture(image), "", None)
        tell(number, len(images), "pictures")


def _unread(source: SourceImage) -> dict[str, Any]:
    return {"verified": False, "error": one_line(source.problem)}


@dataclass(frozen=True)
class _Files:
    """What ``verify`` writes.

    Attributes:
        judge: the reader.
        output, debug: folders for overlays and for pictures of stages.
        bundle: the report of a problem, which is not written yet.
    """

    judge: Verifier
    output: str | Path | None
    debug: str | Path | None
    bundle: ProblemReport | None

    def judged(self, source: SourceImage) -> Verdict | SheetVerdict | None:
        """The verdict on an image, after its pictures are written; None where the image cannot be read."""
        if source.image is not None:
            image = self.judge.read(source.image)
            verdict = self.judge.judge(image, source.path)
            self._write(image, source, verdict)
            return verdict
        if self.bundle is not None and source.path is not None:
            with suppress(InputError):
                self.bundle.add(*source.picture(), _unread(source), {})
        return None

    def _write(self, image: NDArray[Any], source: SourceImage, verdict: Verdict | SheetVerdict) -> None:
        """Write the pictures of a pattern, and add the image to the report."""
        from cmpdesign.files.images import to_png
        from cmpdesign.reading.verify import Verdict
        from extractor.draw import draw_markers, draw_stages

        stages: Mapping[str, NDArray[Any]] = {}
        if isinstance(verdict, Verdict):
            reference = self.judge.extractor.layout_of(verdict.markers)
            if self.output is not None:
                overlay = to_png(draw_markers(image, reference, verdict.markers))
                write_file(Path(self.output) / f"{source.stem}.overlay.png", overlay)
            if self.debug is not None or self.bundle is not None:
                stages = draw_stages(image, reference, verdict.markers)
        if self.debug is not None:
            for number, (stage, picture) in enumerate(stages.items(), start=1):
                write_file(Path(self.debug) / f"{source.stem}.{number}-{stage}.png", to_png(picture))
        if self.bundle is not None:
            self.bundle.add(*source.picture(), verdict.to_json(), stages)


def _document(
    judge: Verifier, images: Sequence[Mapping[str, Any]], found: object
) -> documents.reading.VerifyDocument:
    codes = [one.code.id for one in judge.family if one.code is not None]
    return documents.reading.VerifyDocument.of(
        found,
        format="cmp-verification",
        version=1,
        pattern=judge.reference.pattern,
        digest=judge.reference.digest,
        min_share=judge.options["min_share"],
        verified=all(image["verified"] for image in images),
        images=images,
        **({"codes": codes} if len(judge.family) > 1 else {}),
    )


def _new_report(judge: Verifier, layout_text: str) -> ProblemReport:
    """The bundle of pictures, layout and settings, without a picture."""
    from cmpdesign.reading.problem_report import ProblemReport

    settings = {name: judge.options[name] for name in ("preset", "response", "channels", "min_share")}
    return ProblemReport(layout_text, settings)


def _layout_text(layout: AnyLayout) -> str:
    """The text of a layout file as it is, or as a layout is written."""
    if isinstance(layout, str | Path):
        from cmpdesign.inputs.files import read_text

        return read_text(layout)
    from cmpdesign.api.layouts import read_layout

    return read_layout(layout).to_json()
