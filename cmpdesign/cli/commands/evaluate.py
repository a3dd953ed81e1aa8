"""``cmpdesign evaluate``: the article's experiments on a simulated sensor, and designs compared."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.api import workshop
from cmpdesign.cli.command import Command, examples, new_group
from cmpdesign.cli.derived import derived
from cmpdesign.cli.options import COMPLETIONS
from cmpdesign.cli.terminal import say
from cmpdesign.evaluation.defaults import USUAL_TRIALS

if TYPE_CHECKING:
    from cmpdesign.documents.runs import EvaluateDocument

Report = Mapping[str, Any]
DESIGNS = "cmpdesign evaluate designs tac3d digit -o compared"
QUICK = "cmpdesign evaluate precision -o quick --trials 1"
app = new_group(
    "Repeat the article's experiments on a simulated sensor, and compare designs.\n\nWrites report.html and "
    "report.json. The same command continues an interrupted run.",
    QUICK,
    DESIGNS,
)
DesignsArgument = Annotated[
    list[str],
    typer.Argument(metavar="DESIGN", help="Templates or TOML files.", autocompletion=COMPLETIONS["designs"]),
]


def _compared(*, design: DesignsArgument, **options: Any) -> EvaluateDocument:
    return workshop.evaluate("designs", designs=design, **options)


def experiment(
    *shown: str, trials: str | None = None, calling: Callable[..., Any] | None = None
) -> Callable[[Callable[[Report], Iterator[str]]], None]:
    """Add the command of an experiment; its function gives the lines of its report, and its docstring is the help.

    Args:
        shown: examples.
        trials: help text of the number of trials; None: the experiment has none, and nothing that is random.
        calling: see ``derived``.
    """
    left_out = ("experiment", "designs", *(("trials", "seed", "sensor", "preset") if trials is None else ()))

    def decorated(lines: Callable[[Report], Iterator[str]]) -> None:
        name = lines.__name__

        def call(**options: Any) -> EvaluateDocument:
            return workshop.evaluate(name, **options)  # type: ignore[arg-type]

        def run(done: EvaluateDocument) -> None:
            for line in lines(done.report):
                say(line)

        words = {} if trials is None else {"trials": f"{trials}; None: {USUAL_TRIALS[name]}"}
        ready = derived(workshop.evaluate, name, calling or call, **dict.fromkeys(left_out), **words)(run)
        ready.__doc__ = lines.__doc__
        app.command(name, cls=Command, epilog=examples(*shown))(ready)

    return decorated


@experiment(
    "cmpdesign evaluate precision -o precision --trials 10",
    QUICK,
    trials="places for every object and cube",
)
def precision(report: Report) -> Iterator[str]:
    """Measure the error on five pressed objects, and the edge fitting error of a cube."""
    for mode, one in report["edge_fit_error_mm"].items():
        yield f"edge fitting error, {mode}: {_compared_text(one, ' mm')}"


@experiment(
    "cmpdesign evaluate response -o response",
    "cmpdesign evaluate response -o quick --trials 1 --workers 1",
    trials="places of the cube",
)
def response(report: Report) -> Iterator[str]:
    """Measure the share of a shear that the markers under a cube show."""
    for case, one in report["response"].items():
        yield f"response, {case}: {_compared_text(one)}"


@experiment(
    "cmpdesign evaluate reliability -o reliability --trials 300",
    "cmpdesign evaluate reliability -o quick --trials 1 --seed 7",
    trials="places and lights for every mode",
)
def reliability(report: Report) -> Iterator[str]:
    """Count how often both patterns are read under a ball that presses, then twists or shears."""
    for mode, methods in report["modes"].items():
        counts = ", ".join(f"{name} {one['successful']}" for name, one in methods.items())
        yield f"{mode}, of {report['trials']}: {counts}"


@experiment(
    "cmpdesign evaluate angles -o angles",
    "cmpdesign evaluate angles -o angles --workers 2 --json",
)
def angles(report: Report) -> Iterator[str]:
    """Measure how far a single cell can deform or turn before the cell is lost, against eqs. 1 and 2."""
    for name, one in report["cells"].items():
        for what, limit in one.items():
            largest = list(limit["measured"])[-1]
            lost = _number(limit["measured"][largest], ".1f")
            yield f"{name}, {what}: formula {limit['formula']:.1f}, first lost {lost} at {largest}"


@experiment(
    DESIGNS,
    "cmpdesign evaluate designs mine.toml honeycomb -o compared --trials 1",
    trials="places and lights for every contact",
    calling=_compared,
)
def designs(report: Report) -> Iterator[str]:
    """Compare designs on one sensor: error, share measured, smallest feature, laser time."""
    for name, one in report["designs"].items():
        error = one["surface_rms_mm"]["mean"]
        shown = "nothing read" if error is None else f"surface {1000 * error:.1f} um RMS"
        yield (
            f"{name}: {shown}, {100 * one['measured']['mean']:.1f} % measured, smallest feature "
            f"{one['smallest_feature_mm']:.3f} mm, laser {_number(one['laser_time_s'], '.0f')} s"
        )


def _compared_text(one: Report, unit: str = "") -> str:
    """The figures of both patterns, and the change beside the article's."""
    change, article = (_number(one[name], "+.1f") for name in ("change_percent", "article_change_percent"))
    square, multicolor = (f"{_number(one[name], '.3f')}{unit}" for name in ("square", "multicolor"))
    return f"square {square}, multicolor {multicolor} ({change} %; the article {article} %)"


def _number(value: float | None, form: str) -> str:
    return "none" if value is None else f"{value:{form}}"
