"""Progress on stderr: number, rate and remaining time; nothing without a terminal, with ``--quiet`` or ``--json``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from cmpdesign.cli.mode import current_mode
from cmpdesign.cli.terminal import console, print_step
from cmpdesign.inputs.texts import visible

if TYPE_CHECKING:
    from rich.progress import Progress

# Rates are means over this time; a trial of an experiment takes up to a minute.
SPEED_PERIOD_S = 300.0
Advance = Callable[[str], None]


@contextmanager
def progress_bar(doing: str, total: int | None, *, done: int = 0, unit: str = "") -> Iterator[Advance]:
    """A progress bar that is removed at its end.

    Args:
        doing: text before the bar.
        total: number of steps; None: unknown.
        done: number of steps that an earlier run has done.
        unit: of a step, for the rate, as in "frames".

    Yields:
        The function to call after every step, with a note that stands behind the bar.
    """
    with _progress() as progress:
        if progress is None:
            yield lambda note: None
            return
        task = progress.add_task(visible(doing), total=total, completed=done, note="", rate="")

        def advance(note: str) -> None:
            progress.advance(task)
            progress.update(task, note=visible(note), rate=_rate(progress, unit, done))

        yield advance


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
            self._progress.add_task(visible(doing), total=None, note="", rate="")

    def tell(self, done: int, total: int | None, unit: str) -> None:
        """Show how many of the step's parts are done, or the next step; see ``cmpdesign.watch``."""
        if total is None:
            print_step(f"{unit} begins")
            self.begin(unit)
        elif self._progress is not None and self._progress.task_ids:
            task = self._progress.task_ids[-1]
            self._progress.update(task, completed=done, total=total)
            self._progress.update(task, rate=_rate(self._progress, unit))


@contextmanager
def working(doing: str) -> Iterator[Steps]:
    """Progress of work in steps; the bars are removed at the end. The first step is ``doing``."""
    with _progress() as progress:
        steps = Steps(progress)
        steps.begin(doing)
        yield steps


def _rate(progress: Progress, unit: str, before: int = 0) -> str:
    """The rate of the last task, of which an earlier run did ``before`` parts; Rich has no rate for the first part."""
    task = progress.tasks[-1]
    speed = task.finished_speed or task.speed
    if speed is None and task.elapsed:
        speed = (task.completed - before) / task.elapsed
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
        TextColumn("{task.fields[note]}", markup=False),
    )
    with Progress(
        *columns, console=terminal, transient=True, speed_estimate_period=SPEED_PERIOD_S
    ) as progress:
        yield progress
