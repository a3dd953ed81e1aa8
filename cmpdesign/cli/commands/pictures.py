"""Pictures made and judged: ``render`` and ``verify``, and the ``cameras`` that take them."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

import typer

from cmpdesign import documents
from cmpdesign.api import pictures, sequences, verifying
from cmpdesign.cli.command import app
from cmpdesign.cli.derived import command
from cmpdesign.cli.options import SourcesArgument
from cmpdesign.cli.records import print_parts, print_rows
from cmpdesign.cli.terminal import EXIT_BAD_INPUT, EXIT_NEGATIVE, print_error, print_warning, say


@command(
    app,
    pictures.render,
    "rendering",
    "cmpdesign render layout.json -o sample.png --pitch 22 --tilt 15 --noise 2",
    "cmpdesign render layout.json -o pressed.png --scene pressed-ball --truth pressed.npz",
)
def render(done: documents.runs.RenderDocument) -> None:
    """With a sequence as the scene, a video or a folder of pictures is written."""
    for warning in done.warnings:
        print_warning(warning)
    print_rows(done, "size_px frames fps visible")


LayoutsArgument = Annotated[
    Path,
    typer.Argument(
        metavar="LAYOUT...",
        help="The pattern's layout.json; or those of several pads with different codes: pictures show any one of them.",
    ),
]


def _verified(
    *, layout: LayoutsArgument, images: SourcesArgument, **options: Any
) -> documents.reading.VerifyDocument:
    """The verdicts; the names of further layouts stand before the pictures."""
    layouts = [layout, *(Path(text) for text in takewhile(_is_layout, images))]
    return verifying.verify(layouts, images[len(layouts) - 1 :], **options)


def _is_layout(text: str) -> bool:
    """Whether a text beside the pictures names a layout file; no picture or video ends so."""
    return text.lower().endswith(".json")


@command(
    app,
    verifying.verify,
    "verifying",
    "cmpdesign verify layout.json sample.png -o checked",
    'cmpdesign verify layout.json frames "more/*.png" --json',
    calling=_verified,
    layout=None,
    images=None,
    on_verdict=None,
)
def verify(done: documents.reading.VerifyDocument, given: dict[str, Any]) -> int:
    """Many pictures, videos and cameras are read, too. Exit code: 0 verified, 1 not verified, 2 bad input."""
    errors = [image.error for image in done.images if image.error is not None]
    for error in errors:
        print_error(error)
    if given["report"] is not None:
        say(f"wrote {given['report']}")
    return EXIT_BAD_INPUT if errors else 0 if done.verified else EXIT_NEGATIVE


@command(app, sequences.cameras, "listing", "cmpdesign cameras", "cmpdesign cameras --json")
def cameras(found: documents.runs.CamerasDocument) -> None:
    """track takes a camera by its number, its file, its serial number or a part of its name."""
    if not found.cameras:
        say("no camera is connected")
    for camera in found.cameras:
        print_rows(camera, "number name path serial by_id problem")
        if camera.formats:
            print_parts(camera.formats)
        if camera.ranges:
            print_parts(camera.ranges)
