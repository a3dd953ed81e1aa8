"""Progress on stderr: number, rate and remaining time; nothing without a terminal, with ``--quiet`` or ``--json``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from cmpdesign.cli.mode import current_mode
from cmpdesign.cli.terminal import console
from cmpdesign.inputs.texts import visible

Advance = Callable[[str], None]


@contextmanager
def progress_bar(doing: str, total: int | None, *, done: int = 0, unit: str = "") -> Iterator[Advance]:
    """A progress bar that vanishes at its end.

    Args:
        doing: text before the bar.
        total: number of steps; None: unknown.
        done: number of steps that an earlier run has done.
        unit: of a step, for the rate, as in "frames".

    Yields:
        The function to call after every step, with a note that stands behind the bar.
    """
    terminal = console(stderr=True)
    if not terminal.is_terminal or not current_mode().prints_text:
        yield lambda note: None
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}", markup=False),
        TimeElapsedColumn(),
        TextColumn("remaining"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
    )
    with Progress(*columns, console=terminal, transient=True) as progress:
        task = progress.add_task(visible(doing), total=total, completed=done, note="", rate="")

        def advance(note: str) -> None:
            progress.advance(task)
            speed = progress.tasks[0].finished_speed or progress.tasks[0].speed
            rate = "" if speed is None else f"{speed:.3g} {unit}/s"
            progress.update(task, note=visible(note), rate=rate)

        yield advance


@contextmanager
def working(doing: str) -> Iterator[Callable[[str], None]]:
    """A text with the time that has passed, for work without countable steps; yields the function that changes it."""
    terminal = console(stderr=True)
    if not terminal.is_terminal or not current_mode().prints_text:
        yield lambda text: None
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=terminal, transient=True) as progress:
        task = progress.add_task(visible(doing), total=None)
        yield lambda text: progress.update(task, description=visible(text))
