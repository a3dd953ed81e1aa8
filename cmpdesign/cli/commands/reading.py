"""Pictures and sequences: ``render``, ``verify``, ``cameras``, ``track`` and ``reconstruct``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from cmpdesign import documents
from cmpdesign.api import pictures, sequences, verifying
from cmpdesign.cli.command import app
from cmpdesign.cli.derived import command
from cmpdesign.cli.options import SourcesArgument
from cmpdesign.cli.records import print_parts, print_rows
from cmpdesign.cli.terminal import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_NEGATIVE,
    print_error,
    print_warning,
    say,
    say_text,
)


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
    layouts = [layout, *map(Path, takewhile(lambda text: text.lower().endswith(".json"), images))]
    return verifying.verify(layouts, images[len(layouts) - 1 :], **options)


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


@command(app, sequences.cameras, "listing", "cmpdesign cameras")
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


RecoverOption = Annotated[
    bool, typer.Option("--recover", help="Only complete the FILE of a run that was killed.")
]


def _followed(call: Callable[..., Any], of: Literal["track", "reconstruct"]) -> Callable[..., Any]:
    """The call, which Ctrl-C ends after a frame; with ``--recover`` its file is completed instead."""

    def calling(*, recover: RecoverOption = False, **values: Any) -> Any:
        from cmpdesign.tracking.run import StopRequest, stop_on_signal

        if recover:
            return sequences.recover_run(values["layout"], values["output"], of)
        with stop_on_signal(StopRequest()):
            return call(**values)

    return calling


@command(
    app,
    sequences.track,
    "tracking",
    "cmpdesign track layout.json frames -o run.npz",
    "cmpdesign track layout.json press.mp4 -o run.csv --overlay found.mp4 --frames 100",
    calling=_followed(sequences.track, "track"),
    on_frame=None,
)
def track(
    done: documents.runs.TrackDocument | documents.runs.RecoverDocument, given: Mapping[str, Any]
) -> int:
    """Exit code: 0 done, 1 ended early or nothing tracked, 2 bad input or full disk."""
    if done.format == "cmp-recovery":
        return _recovered(done, given)
    from cmpdesign.reading.quality import reasons_text

    print_rows(
        done,
        "frames starts marker_shares time_ms frames_per_s jitter_px reasons quality contact largest_displacement",
        reasons=reasons_text(done.reasons),
    )
    quiver = given.get("quiver")
    if quiver is not None and str(quiver) not in done.written:
        print_warning(f"{quiver} is not drawn: no frame has a displacement")
    return _exit_code(done)


@command(
    app,
    sequences.reconstruct,
    "reconstructing",
    "cmpdesign reconstruct layout.json rig.toml rest.png frames -o run.npz",
    "cmpdesign reconstruct layout.json rig.toml 0 press.avi -o run.csv --frames 100",
    calling=_followed(sequences.reconstruct, "reconstruct"),
    on_frame=None,
)
def reconstruct(
    done: documents.runs.ReconstructDocument | documents.runs.RecoverDocument, given: Mapping[str, Any]
) -> int:
    """Positions, displacements and normals in mm. Exit code: 0 done, 1 ended early or nothing found, 2 bad input."""
    if done.format == "cmp-recovery":
        return _recovered(done, given)
    print_parts(done.views)
    print_rows(
        done,
        "frames marker_shares positions lost_markers reasons sigma_um systematic_um largest_displacement contact "
        "time_ms",
    )
    return _exit_code(done)


def _recovered(done: documents.runs.RecoverDocument, given: Mapping[str, Any]) -> int:
    for problem in done.problems:
        print_warning(problem)
    if done.frames:
        say(f"{done.frames} frames recovered")
        return 0
    print_warning(f"{given['output']}: the run ended before its first frame; the unfinished file is removed")
    return EXIT_NEGATIVE


def _exit_code(done: documents.runs.TrackDocument | documents.runs.ReconstructDocument) -> int:
    """1 if the run ended early or tracked nothing, 130 if it was stopped by hand, else 0."""
    run = done.found
    if run.stop.is_requested:
        return 0 if run.source.is_live else EXIT_INTERRUPTED
    if run.source.is_live:
        say_text(f"{done.times.text}\n")
    if done.ended_early:
        print_warning(f"{done.ended_early}; the frames until then are written")
    return EXIT_NEGATIVE if done.ended_early or not done.frames.tracked else 0
