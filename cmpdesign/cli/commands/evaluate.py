"""``cmpdesign evaluate``: the article's experiments on a simulated sensor, and designs compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer

from cmpdesign import documents
from cmpdesign.api import workshop
from cmpdesign.cli.command import Command, examples, new_group
from cmpdesign.cli.derived import derived
from cmpdesign.cli.options import COMPLETIONS
from cmpdesign.cli.records import print_table
from cmpdesign.evaluation.defaults import USUAL_TRIALS

Report = Mapping[str, Any]
Table = Mapping[str, Mapping[str, float | None]]
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


def _compared(*, design: DesignsArgument, **options: Any) -> documents.runs.EvaluateDocument:
    return workshop.evaluate("designs", designs=design, **options)


def experiment(
    *shown: str, trials: str | None = None, calling: Callable[..., Any] | None = None
) -> Callable[[Callable[[Report], Table]], None]:
    """Add the command of an experiment; its function gives a table of its report, and its docstring is the help.

    Args:
        shown: examples.
        trials: help text of the number of trials; None: the experiment has none, and nothing that is random.
        calling: see ``derived``.
    """
    left_out = ("experiment", "designs", *(("trials", "seed", "sensor", "preset") if trials is None else ()))

    def decorated(table: Callable[[Report], Table]) -> None:
        name = table.__name__

        def call(**options: Any) -> documents.runs.EvaluateDocument:
            return workshop.evaluate(name, **options)  # type: ignore[arg-type]

        def run(done: documents.runs.EvaluateDocument) -> None:
            print_table(table(done.report))

        words = {} if trials is None else {"trials": f"{trials}; None: {USUAL_TRIALS[name]}"}
        ready = derived(workshop.evaluate, name, calling or call, **dict.fromkeys(left_out), **words)(run)
        ready.__doc__ = table.__doc__
        app.command(name, cls=Command, epilog=examples(*shown))(ready)

    return decorated


def _changed(what: str, rows: Report) -> Table:
    """The figures of both patterns, and the change beside the article's."""
    names = ("square", "multicolor", "change_percent", "article_change_percent")
    return {f"{what}, {case}": {name: one[name] for name in names} for case, one in rows.items()}


@experiment(
    "cmpdesign evaluate precision -o precision --trials 10", QUICK, trials="places for every object and cube"
)
def precision(report: Report) -> Table:
    """Measure the error on five pressed objects, and the edge fitting error of a cube."""
    return _changed("edge fitting error in mm", report["edge_fit_error_mm"])


@experiment(
    "cmpdesign evaluate response -o response",
    "cmpdesign evaluate response -o quick --trials 1 --workers 1",
    trials="places of the cube",
)
def response(report: Report) -> Table:
    """Measure the share of a shear that the markers under a cube show."""
    return _changed("response", report["response"])


@experiment(
    "cmpdesign evaluate reliability -o reliability --trials 300",
    "cmpdesign evaluate reliability -o quick --trials 1 --seed 7",
    trials="places and lights for every mode",
)
def reliability(report: Report) -> Table:
    """Count how often both patterns are read under a ball that presses, then twists or shears."""
    return {
        f"{mode}, of {report['trials']}": {name: one["successful"] for name, one in methods.items()}
        for mode, methods in report["modes"].items()
    }


@experiment("cmpdesign evaluate angles -o angles", "cmpdesign evaluate angles -o angles --workers 2 --json")
def angles(report: Report) -> Table:
    """Measure how far a single cell can deform or turn before the cell is lost, against eqs. 1 and 2."""
    rows = {}
    for name, one in report["cells"].items():
        for what, limit in one.items():
            largest = list(limit["measured"])[-1]
            rows[f"{name}, {what}, {largest}"] = {
                "formula": limit["formula"],
                "first_lost": limit["measured"][largest],
            }
    return rows


@experiment(
    DESIGNS,
    "cmpdesign evaluate designs mine.toml honeycomb -o compared --trials 1",
    trials="places and lights for every contact",
    calling=_compared,
)
def designs(report: Report) -> Table:
    """Compare designs on one sensor: error, share measured, smallest feature, laser time."""
    return {
        name: {
            "surface_rms_mm": one["surface_rms_mm"]["mean"],
            "measured_share": one["measured"]["mean"],
            "smallest_feature_mm": one["smallest_feature_mm"],
            "laser_time_s": one["laser_time_s"],
        }
        for name, one in report["designs"].items()
    }
