"""What the commands share that follow a source to its end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

from cmpdesign.cli.terminal import console, print_warning
from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from cmpdesign.tracking.run import TrackingRun

EXIT_NOT_TRACKED = 1
EXIT_INTERRUPTED = 130


def run_with_progress(run: TrackingRun, doing: str) -> None:
    """Run to the end, or to the first Ctrl-C, with a bar that says what is being done.

    Raises:
        OutputError: something could not be written.
    """
    from cmpdesign.tracking.run import stop_on_signal

    with stop_on_signal(run.stop), _progress_bar(run, doing) as watch:
        run.go(watch)


@contextmanager
def _progress_bar(run: TrackingRun, doing: str) -> Iterator[Callable[[Any], None]]:
    """A bar on stderr where a terminal shows it: frames, and how many are tracked."""
    terminal = console(stderr=True)
    if not terminal.is_terminal:
        yield lambda frame: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    total = run.limit or run.source.total
    columns = (
        TextColumn(doing),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=terminal, transient=True) as progress:
        task = progress.add_task(doing, total=total, note="")
        yield lambda frame: progress.update(
            task, advance=1, note=f"{run.tally.tracked} tracked, {frame.elapsed_ms:.1f} ms"
        )


def exit_with_status(run: TrackingRun) -> None:
    """The exit code: 0 done, 1 ended early or nothing tracked, 130 stopped by hand."""
    if run.stop.asked:
        by_design = run.source.name.startswith("camera")  # there is no other way to end a camera's run
        raise typer.Exit(0 if by_design else EXIT_INTERRUPTED)
    if not run.tally.frames:
        raise CmpDesignError(f"{run.source.name}: no frame could be read")
    if run.ended_early:
        print_warning(f"{run.ended_early}; these are written")
    if run.ended_early or not run.tally.tracked:
        raise typer.Exit(EXIT_NOT_TRACKED)


def require_positive(option: str, value: float | None) -> None:
    """A number above 0, where one is given."""
    if value is not None and not 0 < value < float("inf"):
        raise CmpDesignError(f"{option} is {value:g}; expected a number above 0")
