"""``cmpdesign verify``: verifies images against a layout.

An image that shows the code of a print sheet is judged as a print: its layout, scales and skew.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.image_options import ChannelsOption, MaxPixelsOption
from cmpdesign.cli.response import METAVAR, READING_HELP, parse_reading_response
from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    console,
    error_on_one_line,
    print_document,
    print_error,
    printable_path,
)
from cmpdesign.inputs.files import MOST_PIXELS

if TYPE_CHECKING:
    from cmpdesign.api.pictures import Verifier
    from cmpdesign.files.images import Image
    from cmpdesign.products.sheet.verdict import SheetVerdict
    from cmpdesign.reading.verify import Verdict
    from extractor.layout.reference import Reference

EXIT_NOT_VERIFIED = 1


@dataclass(frozen=True, eq=False)
class Outcome:
    """The name of an image with its verdict, or with the error of reading the image."""

    name: str
    verdict: Verdict | SheetVerdict | None
    error: str | None

    @property
    def exit_code(self) -> int:
        """0 verified, 1 not verified, 2 not readable."""
        if self.verdict is None:
            return EXIT_BAD_INPUT
        return 0 if self.verdict.verified else EXIT_NOT_VERIFIED

    def to_json(self) -> dict[str, Any]:
        if self.verdict is None:
            return {"image": self.name, "verified": False, "error": self.error}
        return {"image": self.name, **self.verdict.to_json()}


def verify(
    layout: Annotated[Path, typer.Argument(metavar="LAYOUT", help="The pattern's layout.json.")],
    images: Annotated[
        list[Path],
        typer.Argument(metavar="IMAGE...", help="Color pictures, 8 or 16 bits, or folders of pictures."),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for overlay pictures and verify.json.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
    debug: Annotated[Path | None, typer.Option(help="Folder for a picture of every stage.")] = None,
    min_share: Annotated[
        float, typer.Option(min=0, max=1, help="Share of the visible markers that must be measured.")
    ] = 0.9,
    sheet_dpi: Annotated[
        float | None,
        typer.Option(
            min=0, help="The pictures are print sheets of this resolution (0: unknown), whatever files say."
        ),
    ] = None,
    response: Annotated[str | None, typer.Option(metavar=METAVAR, help=READING_HELP)] = None,
    channels: ChannelsOption = "bgr",
    max_pixels: MaxPixelsOption = MOST_PIXELS,
) -> None:
    """Extract pictures and check the numbering. Exit code: 0 verified, 1 not verified, 2 bad input."""
    from cmpdesign.api.pictures import Verifier
    from cmpdesign.files.image_folders import without_folders
    from extractor import load_layout

    reference, known = load_layout(layout), parse_reading_response(response)
    verifier = _ImageVerifier(
        Verifier(reference, min_share, known, channels, sheet_dpi, max_pixels), output, debug
    )
    images = without_folders(images)
    names = _unique_names([path.stem for path in images])
    outcomes = [
        verifier.verify_image(path, name)
        for path, name in _with_progress(list(zip(images, names, strict=True)))
    ]
    report = _outcomes_to_json(reference, outcomes, min_share)
    if output is not None:
        from cmpdesign.files.atomic import write_file

        write_file(output / "verify.json", report)
    # Printed after the progress bar has ended, because the bar redirects standard output.
    print_document(report if as_json else _format_outcomes(outcomes))
    raise typer.Exit(max(outcome.exit_code for outcome in outcomes))


@dataclass(frozen=True, eq=False)
class _ImageVerifier:
    """Verifies image files and writes their pictures."""

    verifier: Verifier
    output: Path | None
    debug: Path | None

    def verify_image(self, path: Path, name: str) -> Outcome:
        """Verify one image and write its pictures; an unreadable image is reported on stderr."""
        from cmpdesign.files.images import ImageFileError
        from cmpdesign.reading.verify import Verdict

        try:
            image = self.verifier.read(path)
        except ImageFileError as error:
            print_error(error)
            return Outcome(printable_path(path), None, error_on_one_line(error))
        verdict = self.verifier.judge(image, path)
        if isinstance(verdict, Verdict):
            _write_pictures(image, self.verifier.reference, verdict, name, self.output, self.debug)
        return Outcome(printable_path(path), verdict, None)


def _write_pictures(
    image: Image, reference: Reference, verdict: Verdict, name: str, output: Path | None, debug: Path | None
) -> None:
    from cmpdesign.files.atomic import write_file
    from cmpdesign.files.images import to_png

    if output is not None:
        from extractor.draw import draw_markers

        write_file(output / f"{name}.overlay.png", to_png(draw_markers(image, reference, verdict.markers)))
    if debug is not None:
        from extractor.draw import draw_stages

        pictures = draw_stages(image, reference, verdict.markers)
        for number, (stage, picture) in enumerate(pictures.items(), start=1):
            write_file(debug / f"{name}.{number}-{stage}.png", to_png(picture))


def _format_outcomes(outcomes: list[Outcome]) -> str:
    """One line for every image that was read, and one for each hint on a pattern that was found."""
    return "".join(
        f"{item.name}: {_format_verdict(item.verdict)}\n" for item in outcomes if item.verdict is not None
    )


def _format_verdict(verdict: Verdict | SheetVerdict) -> str:
    from cmpdesign.reading.verify import Verdict

    if not isinstance(verdict, Verdict):
        return verdict.line()
    repaired = verdict.repaired + verdict.fitted
    counts = f"{verdict.measured} of {verdict.present} measured, {repaired} repaired, {verdict.lost} lost"
    head = "verified" if verdict.verified else f"not verified: {verdict.reason}"
    line = f"{head} ({counts}, {sum(verdict.markers.timings_ms.values()):.1f} ms)"
    quality = verdict.markers.quality
    hints = quality.hints if quality is not None and verdict.markers.found else ()
    return "".join([line, *(f"\n  {hint}" for hint in hints if hint not in head)])


def _outcomes_to_json(reference: Reference, outcomes: list[Outcome], min_share: float) -> str:
    document = {
        "format": "cmp-verification",
        "version": 1,
        "pattern": reference.pattern,
        "digest": reference.digest,
        "min_share": min_share,
        "verified": all(outcome.exit_code == 0 for outcome in outcomes),
        "images": [outcome.to_json() for outcome in outcomes],
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _unique_names(stems: list[str]) -> list[str]:
    """Names for the written files: the stems, numbered where several images have the same stem."""
    names: list[str] = []
    for stem in stems:
        name, number = stem, 1
        while name in names:
            number += 1
            name = f"{stem}-{number}"
        names.append(name)
    return names


def _with_progress(items: list[tuple[Path, str]]) -> Iterable[tuple[Path, str]]:
    """The items, with a progress bar if there are several and stderr is a terminal."""
    terminal = console(stderr=True)
    if len(items) < 2 or not terminal.is_terminal:
        return items
    return _items_with_bar(items)


def _items_with_bar(items: list[tuple[Path, str]]) -> Iterator[tuple[Path, str]]:
    from rich.progress import track

    yield from track(items, description="verifying", console=console(stderr=True), transient=True)
