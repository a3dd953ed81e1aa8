"""Progress on stderr: number, rate and remaining time; nothing without a terminal, with ``--quiet`` or ``--json``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from cmpdesign.cli.terminal import console, current_mode, print_step, print_warning, say_text
from cmpdesign.inputs.texts import visible
from cmpdesign.watch import watched

if TYPE_CHECKING:
    from rich.progress import Progress

# Rates are means over this time; a trial of an experiment takes up to a minute.
SPEED_PERIOD_S = 300.0


class Steps:
    """Steps one after another; each step has a bar as soon as the number of its parts is known."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress

    def begin(self, doing: str) -> None:
        """Begin a step; the last state of the previous step is shown, also of a very short step."""
        if self._progress is not None:
            self._progress.refresh()
            for task in self._progress.task_ids:
                self._progress.remove_task(task)
            self._progress.add_task(visible(doing), total=None, rate="")

    def notice(self, text: str, is_doubt: bool) -> None:
        """Print a line above the bars: a warning on standard error, another line on standard output."""
        if self._progress is not None:  # the bars redirect standard output
            self._progress.stop()
        if is_doubt:
            print_warning(text)
        else:
            say_text(f"{text}\n")
        if self._progress is not None:
            self._progress.start()

    def tell(self, done: int, total: int | None, unit: str) -> None:
        """Show how many of the step's parts are done, or the next step; see ``cmpdesign.watch``."""
        if total is None:
            print_step(f"{unit} begins")
            self.begin(unit)
        elif self._progress is not None and self._progress.task_ids:
            task = self._progress.task_ids[-1]
            self._progress.update(task, completed=done, total=total or None)
            self._progress.update(task, rate=_rate(self._progress, unit))


@contextmanager
def working(doing: str) -> Iterator[None]:
    """Show the progress of the work within this context, by ``cmpdesign.watch``; the bars are removed at the end.

    Args:
        doing: the first step.
    """
    with _progress() as progress:
        steps = Steps(progress)
        steps.begin(doing)
        with watched(steps.tell, steps.notice):
            yield


def _rate(progress: Progress, unit: str) -> str:
    """The rate of the last task; Rich has no rate for the first part."""
    task = progress.tasks[-1]
    speed = task.finished_speed or task.speed
    if speed is None and task.elapsed:
        speed = task.completed / task.elapsed
    return "" if speed is None else f"{speed:.3g} {unit}/s"


@contextmanager
def _progress() -> Iterator[Progress | None]:
    """Bars on stderr; None where no progress is shown."""
    terminal = console(stderr=True)
    if not terminal.is_terminal or not current_mode().prints_text:
        yield None
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
    )
    with Progress(
        *columns, console=terminal, transient=True, speed_estimate_period=SPEED_PERIOD_S
    ) as progress:
        yield progress
