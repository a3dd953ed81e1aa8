"""Progress and exit codes of the commands that run from a source: ``track`` and ``reconstruct``."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import typer

from cmpdesign.cli.progress import progress_bar
from cmpdesign.cli.terminal import (
    EXIT_INTERRUPTED,
    finish,
    print_step,
    print_warning,
    printable_path,
    say,
    say_text,
)
from cmpdesign.errors import CmpDesignError, OutputError
from cmpdesign.inputs.texts import visible

if TYPE_CHECKING:
    from cmpdesign.documents.runs import ContactPart, FramesPart, ReconstructDocument, TrackDocument
    from cmpdesign.tracking.jobs.job import Job
    from cmpdesign.tracking.live.view import LiveCount
    from cmpdesign.tracking.run import TrackingRun
    from cmpdesign.tracking.sources import FrameSource

    Summary = TypeVar("Summary", TrackDocument, ReconstructDocument)

RecoverOption = Annotated[
    bool, typer.Option("--recover", help="Only complete the FILE of a run that was killed.")
]
EXIT_NOT_TRACKED = 1


def run_and_report(job: Job[Summary], doing: str, show: Callable[[Summary], None]) -> None:
    """Follow a source with a progress bar, print the summary and the written files, and end the command.

    Args:
        job: the work.
        doing: text of the progress bar.
        show: prints the summary for people.

    Raises:
        CmpDesignError: an input that cannot be used, or no frame could be read.
        OutputError: a file could not be written; the summary covers the frames so far.
    """
    from cmpdesign.tracking.jobs.job import write_summary

    run: TrackingRun = job.prepare()
    print_step(f"{run.source.name} is open")
    for warning in (*run.warnings, *run.source.notes):
        print_warning(warning)
    said = len(run.source.notes)
    try:
        run_with_progress(run, doing)
    except OutputError:
        with suppress(OutputError, CmpDesignError):
            done = write_summary(run, job)
            show(done)
            _print_written(done.written[1:])
        raise
    if run.stop.is_requested and not run.statistics.frames:
        raise typer.Exit(exit_status(run))
    for note in run.source.notes[said:]:
        print_warning(note)
    done = write_summary(run, job)
    show(done)
    _print_written(done.written)
    finish(lambda: done, exit_status(run))


def frames_text(frames: FramesPart) -> str:
    """The numbers of frames, in words."""
    others = {name: getattr(frames, name) for name in ("lost", "unreadable", "other_size")}
    not_tracked = "".join(f", {count} {name.replace('_', ' ')}" for name, count in others.items() if count)
    return f"{frames.read} read, {frames.tracked} tracked{not_tracked}"


def contact_text(contact: ContactPart) -> str:
    """The contacts of a run, in words."""
    reasons = contact.reasons.items()
    text = ", ".join(f"{count} x {reason.replace('_', ' ')}" for reason, count in reasons)
    press = contact.largest
    if press is None:
        return text
    pairs = zip(press.force_n, press.force_sigma_n, strict=True)
    force = ", ".join(f"{value:.3f} ± {sigma:.3f}" for value, sigma in pairs)
    return f"{text}; largest ({force}) N in frame {press.frame}"


def run_with_progress(run: TrackingRun, doing: str) -> None:
    """Run to the end or to the first Ctrl-C, with a progress bar.

    Args:
        run: the run.
        doing: text of the progress bar.

    Raises:
        OutputError: a file could not be written.
    """
    from cmpdesign.tracking.run import stop_on_signal

    _say_times(run.source)
    total = run.limit if run.limit is not None else run.source.total
    if run.live is not None:
        say(f"live at {run.live.address}")
    try:
        with stop_on_signal(run.stop), progress_bar(doing, total, unit="frames") as advance:
            run.go(lambda frame: advance(f"{run.statistics.tracked} tracked, {frame.elapsed_ms:.1f} ms"))
    finally:
        if run.live is not None:
            _report_live(run.live.count())


def _say_times(source: FrameSource) -> None:
    """The first line of a run: how the times of the frames are found; of a live source the last one tells it."""
    if source.times.is_doubtful:
        print_warning(f"{source.name}: {source.times.text}")
    elif not source.is_live:
        say_text(f"{visible(source.name)}: {source.times.text}\n")


def _report_live(count: LiveCount) -> None:
    """Print the number of frames that viewers did not receive."""
    if count.failure:
        print_warning(f"the live server stopped after {count.sent} frames ({count.failure})")
    if count.left_out:
        print_warning(
            f"{count.left_out} of {count.sent + count.left_out} frames were not shown live: "
            "there was no time to send them"
        )
    if count.is_viewer_behind:
        print_warning(
            "a live viewer read more slowly than the frames were made; some frames were not sent to the "
            "viewer"
        )


def exit_status(run: TrackingRun) -> int:
    """The exit code: 1 if the run ended early or tracked nothing, 130 if it was stopped by hand, else 0."""
    if run.stop.is_requested:
        return 0 if run.source.is_live else EXIT_INTERRUPTED
    if run.source.is_live:
        say_text(f"{run.source.times.text}\n")
    if run.ended_early:
        print_warning(f"{run.ended_early}; the frames until then are written")
    return EXIT_NOT_TRACKED if run.ended_early or not run.statistics.tracked else 0


def recover_and_report(layout: Path, output: Path, of: Literal["track", "reconstruct"]) -> None:
    """Complete the table of a killed run, and print the numbers of recovered and lost frames; exit with 1 for none.

    Raises:
        CmpDesignError: there is no table to recover, or no complete frame is left.
        OutputError: the table cannot be written.
    """
    from cmpdesign.api.sequences import recover_run

    recovered = recover_run(layout, output, of)
    for problem in recovered.problems:
        print_warning(problem)
    if recovered.frames:
        say(f"wrote {printable_path(output)}: {recovered.frames} frames recovered")
    else:
        print_warning(
            f"{printable_path(output)}: the run ended before its first frame; the unfinished file is removed"
        )
    finish(lambda: recovered, 0 if recovered.frames else EXIT_NOT_TRACKED)


def _print_written(paths: tuple[str, ...]) -> None:
    for path in paths:
        say(f"wrote {path}")


def require_positive(option: str, value: float | None) -> None:
    """Check that the value of an option is finite and above 0, or not given.

    Raises:
        CmpDesignError: another value.
    """
    if value is not None and not 0 < value < float("inf"):
        raise CmpDesignError(f"{option} is {value:g}; expected a number above 0")
