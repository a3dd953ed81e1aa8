"""Progress and exit codes of the commands that run from a source: ``track`` and ``reconstruct``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmpdesign.cli.terminal import EXIT_INTERRUPTED, console, print_warning, printable_path
from cmpdesign.errors import CmpDesignError

if TYPE_CHECKING:
    from cmpdesign.tracking.run import TrackingRun

EXIT_NOT_TRACKED = 1


def run_with_progress(run: TrackingRun, doing: str) -> None:
    """Run to the end or to the first Ctrl-C, with a progress bar.

    Args:
        run: the run.
        doing: text of the progress bar.

    Raises:
        OutputError: a file could not be written.
    """
    from cmpdesign.tracking.run import stop_on_signal

    with stop_on_signal(run.stop), _progress_bar(run, doing) as watch:
        run.go(watch)


@contextmanager
def _progress_bar(run: TrackingRun, doing: str) -> Iterator[Callable[[Any], None]]:
    """A progress bar on stderr (if a terminal): frames and tracked frames; yields the function to call per frame."""
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
            task, advance=1, note=f"{run.statistics.tracked} tracked, {frame.elapsed_ms:.1f} ms"
        )


def exit_with_status(run: TrackingRun) -> None:
    """Exit with 1 if the run ended early or tracked nothing, with 130 if it was stopped by hand.

    Raises:
        CmpDesignError: no frame could be read.
    """
    if run.stop.is_requested:
        raise typer.Exit(0 if run.source.is_live else EXIT_INTERRUPTED)
    if not run.statistics.frames:
        raise CmpDesignError(f"{run.source.name}: no frame could be read")
    if run.ended_early:
        print_warning(f"{run.ended_early}; these are written")
    if run.ended_early or not run.statistics.tracked:
        raise typer.Exit(EXIT_NOT_TRACKED)


def recover_and_report(output: Path, rows_per_frame: int) -> None:
    """Complete the table of a killed run, and print what was recovered and what was not; exit with 1 for nothing.

    Raises:
        CmpDesignError: there is nothing to recover, or no whole frame is left.
        OutputError: the table cannot be written.
    """
    from cmpdesign.tracking.sinks.tables import recover_table

    recovered = recover_table(output, rows_per_frame)
    for problem in recovered.problems:
        print_warning(problem)
    if not recovered.frames:
        print_warning(
            f"{printable_path(output)}: the run was ended before its first frame was written; what it left is removed"
        )
        raise typer.Exit(EXIT_NOT_TRACKED)
    console().print(f"wrote {printable_path(output)}: {recovered.frames} frames recovered")


def print_written(paths: Iterable[Path]) -> None:
    """Print one line for every written file."""
    for path in paths:
        console().print(f"wrote {printable_path(path)}")


def require_positive(option: str, value: float | None) -> None:
    """Check that the value of an option is finite and above 0, or not given.

    Raises:
        CmpDesignError: another value.
    """
    if value is not None and not 0 < value < float("inf"):
        raise CmpDesignError(f"{option} is {value:g}; expected a number above 0")
