"""``cmpdesign verify``: verifies images against a layout.

An image that shows the code of a print sheet is judged as a print: layout, scales and skew are measured.
"""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.api import verifying
from cmpdesign.cli.derived import derived
from cmpdesign.cli.options.images import SourcesArgument
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    finish,
    print_error,
    print_step,
    printable_path,
    say_text,
)
from cmpdesign.watch import watched

if TYPE_CHECKING:
    from cmpdesign.products.sheet.verdict import SheetVerdict
    from cmpdesign.reading.verify import Verdict

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


@derived(verifying.verify, layout=None, images=None, on_verdict=None)
def verify(report: Path | None, *, layout: LayoutsArgument, images: SourcesArgument, **options: Any) -> None:
    """Many pictures, videos and cameras are read, too. Exit code: 0 verified, 1 not verified, 2 bad input."""
    layouts = [layout, *(Path(text) for text in takewhile(_is_layout, images))]
    lines: list[str] = []

    def keep(name: str, verdict: Verdict | SheetVerdict) -> None:
        lines.append(f"{name}: {_format_verdict(verdict)}\n")
        print_step(f"{name} judged")

    with working("verifying") as steps, watched(steps.tell):
        done = verifying.verify(
            layouts, images[len(layouts) - 1 :], report=report, on_verdict=keep, **options
        )
    for image in done.images:
        if image.error is not None:
            print_error(image.error)
    # Printed after the progress bar has ended, because the bar redirects standard output.
    say_text("".join(lines))
    if report is not None:
        say_text(f"wrote {printable_path(report)}\n")
    is_bad = any(image.error is not None for image in done.images)
    finish(lambda: done, EXIT_BAD_INPUT if is_bad else 0 if done.verified else EXIT_NOT_VERIFIED)


def _is_layout(text: str) -> bool:
    """Whether a text beside the pictures names a layout file; no picture or video ends so."""
    return text.lower().endswith(".json")


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
