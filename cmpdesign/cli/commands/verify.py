"""``cmpdesign verify``: verifies images against a layout.

An image that shows the code of a print sheet is judged as a print: layout, scales and skew are measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from cmpdesign.api import pictures
from cmpdesign.cli.derived import derived
from cmpdesign.cli.options.images import SourcesArgument
from cmpdesign.cli.progress import progress_bar
from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    error_on_one_line,
    finish,
    print_error,
    print_step,
    printable_path,
    say_text,
)
from cmpdesign.errors import InputError, parameter
from cmpdesign.inputs.files import read_text, require_suffix

if TYPE_CHECKING:
    from cmpdesign.documents.reading import VerifyDocument
    from cmpdesign.files.images import Image
    from cmpdesign.products.sheet.verdict import SheetVerdict
    from cmpdesign.reading.problem_report import ProblemReport
    from cmpdesign.reading.verify import Verdict
    from cmpdesign.tracking.source_images import SourceImage
    from extractor.layout.reference import Reference

EXAMPLES = (
    "cmpdesign verify layout.json sample.png -o checked",
    'cmpdesign verify layout.json frames "more/*.png" --json',
)
EXIT_NOT_VERIFIED = 1


LayoutsArgument = Annotated[
    Path,
    typer.Argument(
        metavar="LAYOUT...",
        help="The pattern's layout.json; or those of several pads with different codes: pictures show any one of them.",
    ),
]
OutputOption = Annotated[
    Path | None, typer.Option("-o", "--output", help="Folder for overlay pictures and verify.json.")
]
DebugOption = Annotated[Path | None, typer.Option(help="Folder for a picture of every stage.")]
ReportOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Bundle for a report of a problem, .zip: the pictures as they are, EXIF included, the layout, settings, "
        "versions and the stages.",
    ),
]
FramesOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Read this many frames of each video, camera or stream. [default: all of a video, one of a camera or "
        "stream]",
    ),
]
BitsOption = Annotated[
    int | None,
    typer.Option(
        min=8,
        max=16,
        help="Bits of the camera's values in pictures of 16 bits. [default: found from the values]",
    ),
]


@derived(pictures.verify, layout=None, image=None, report=None)
def verify(
    *,
    layout: LayoutsArgument,
    images: SourcesArgument,
    output: OutputOption = None,
    debug: DebugOption = None,
    report: ReportOption = None,
    frames: FramesOption = None,
    bits: BitsOption = None,
    **options: Any,
) -> None:
    """Many pictures, videos and cameras are read, too. Exit code: 0 verified, 1 not verified, 2 bad input."""
    from cmpdesign.inputs.sources import name_sources
    from cmpdesign.tracking.source_images import count_images, source_images
    from cmpdesign.tracking.sources import Reading
    from extractor.layout.layout_file import layouts_of

    require_suffix("report", report, ".zip")
    layouts = [layout, *(Path(text) for text in takewhile(_is_layout, images))]
    if report is not None and len(layouts) > 1:
        raise InputError(
            f"{parameter('report')} bundles one layout, and {len(layouts)} are given; give the pad's"
        )
    family = layouts_of(layouts)
    judge = pictures.Verifier(family, **options)
    bundle = pictures.new_report(judge, read_text(layout)) if report is not None else None
    verifier = _ImageVerifier(judge, _Folders(output, debug), bundle)
    sources = name_sources(images[len(layouts) - 1 :])
    outcomes = []
    with progress_bar("verifying", count_images(sources, frames), unit="pictures") as advance:
        for image in source_images(sources, frames, Reading(max_pixels=judge.max_pixels, bits=bits)):
            outcomes.append(verifier.verify_image(image))
            advance("")
    document = _to_document(family, outcomes, judge.min_share)
    if output is not None:
        from cmpdesign.files.atomic import write_file

        write_file(output / "verify.json", document.to_json())
    if report is not None and bundle is not None:
        bundle.write(report)
    # Printed after the progress bar has ended, because the bar redirects standard output.
    say_text("".join(outcome.text for outcome in outcomes))
    if report is not None:
        say_text(f"wrote {printable_path(report)}\n")
    finish(lambda: document, max(outcome.exit_code for outcome in outcomes))


def _is_layout(text: str) -> bool:
    """Whether a text beside the pictures names a layout file; no picture or video ends so."""
    return text.lower().endswith(".json")


class _Folders(NamedTuple):
    """Folders for overlays and for pictures of stages."""

    output: Path | None
    debug: Path | None


@dataclass(frozen=True)
class Outcome:
    """The result of one image.

    Attributes:
        fields: of the image's part of the document.
        text: lines for people; empty for an image that was not read.
        exit_code: 0 verified, 1 not verified, 2 not readable.
    """

    fields: dict[str, Any]
    text: str
    exit_code: int


@dataclass(frozen=True, eq=False)
class _ImageVerifier:
    """Verifies images, and writes their pictures and the report of a problem."""

    judge: pictures.Verifier
    folders: _Folders
    bundle: ProblemReport | None

    def verify_image(self, source: SourceImage) -> Outcome:
        """Verify one image and write its pictures; an unreadable image is reported on stderr."""
        name = printable_path(source.name)
        if source.image is None:
            print_error(source.problem)
            problem = error_on_one_line(source.problem)
            self._report_unread(source, problem)
            return Outcome({"image": name, "verified": False, "error": problem}, "", EXIT_BAD_INPUT)
        image = self.judge.read(source.image)
        verdict = self.judge.judge(image, source.path)
        self._keep(image, source, verdict)
        print_step(f"{name} judged")
        return Outcome(
            {"image": name, **verdict.to_json()},
            f"{name}: {_format_verdict(verdict)}\n",
            0 if verdict.verified else EXIT_NOT_VERIFIED,
        )

    def _report_unread(self, source: SourceImage, problem: str) -> None:
        """Put the file of an image that cannot be read into the report, if there is a file."""
        from cmpdesign.errors import InputError

        if self.bundle is not None and source.path is not None:
            with suppress(InputError):
                self.bundle.add(*source.picture(), {"verified": False, "error": problem}, {})

    def _keep(self, image: Image, source: SourceImage, verdict: Verdict | SheetVerdict) -> None:
        """Write the pictures of a pattern, and add the image to the report."""
        from cmpdesign.reading.verify import Verdict

        stages: Mapping[str, Image] = {}
        if isinstance(verdict, Verdict):
            reference = self.judge.extractor.layout_of(verdict.markers)
            _write_pictures(image, reference, verdict, source.stem, self.folders)
            if self.bundle is not None:
                from extractor.draw import draw_stages

                stages = draw_stages(image, reference, verdict.markers)
        if self.bundle is not None:
            self.bundle.add(*source.picture(), verdict.to_json(), stages)


def _write_pictures(
    image: Image, reference: Reference, verdict: Verdict, name: str, folders: _Folders
) -> None:
    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import to_png

    if folders.output is not None:
        from extractor.draw import draw_markers

        overlay = to_png(draw_markers(image, reference, verdict.markers))
        write_file(folders.output / f"{name}.overlay.png", overlay)
    if folders.debug is not None:
        from extractor.draw import draw_stages

        drawn = draw_stages(image, reference, verdict.markers)
        for number, (stage, picture) in enumerate(drawn.items(), start=1):
            write_file(folders.debug / f"{name}.{number}-{stage}.png", to_png(picture))


def _format_verdict(verdict: Verdict | SheetVerdict) -> str:
    """One line, and one for each hint on a pattern that was found."""
    from cmpdesign.reading.verify import Verdict

    if not isinstance(verdict, Verdict):
        return verdict.line()
    repaired = verdict.repaired + verdict.fitted
    pad = "" if verdict.markers.code is None else f"pad {verdict.markers.code}, "
    counts = (
        f"{pad}{verdict.measured} of {verdict.present} measured, {repaired} repaired, {verdict.lost} lost"
    )
    head = "verified" if verdict.verified else f"not verified: {verdict.reason}"
    line = f"{head} ({counts}, {sum(verdict.markers.timings_ms.values()):.1f} ms)"
    quality = verdict.markers.quality
    hints = quality.hints if quality is not None and verdict.markers.found else ()
    return "".join([line, *(f"\n  {hint}" for hint in hints if hint not in head)])


def _to_document(family: Sequence[Reference], outcomes: list[Outcome], min_share: float) -> VerifyDocument:
    from cmpdesign.documents.reading import ImagePart, VerifyDocument

    reference, codes = family[0], tuple(one.code.id for one in family if one.code is not None)
    return VerifyDocument(
        format="cmp-verification",
        version=1,
        pattern=reference.pattern,
        digest=reference.digest,
        min_share=min_share,
        verified=all(outcome.exit_code == 0 for outcome in outcomes),
        images=tuple(ImagePart(**outcome.fields) for outcome in outcomes),
        **({"codes": codes} if len(family) > 1 else {}),
    )
