"""``cmpdesign evaluate``: the article's experiments on a simulated sensor, and designs compared."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from cmpdesign.cli.command import Command, Group, examples
from cmpdesign.cli.options.images import PresetOption
from cmpdesign.cli.progress import progress_bar
from cmpdesign.cli.terminal import EXIT_INTERRUPTED, finish, print_step, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluate.defaults import USUAL_TRIALS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from cmpdesign.evaluate.designs import DesignEntry

app = typer.Typer(
    cls=Group,
    epilog=examples(
        "cmpdesign evaluate precision -o quick --trials 1",
        "cmpdesign evaluate designs tac3d digit -o compared",
    ),
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Repeat the article's experiments on a simulated sensor, and compare designs.\n\nWrites report.html and "
    "report.json. The same command continues an interrupted run.",
)

Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the report and the journal.")
]
Seed = Annotated[
    int, typer.Option(min=0, help="Seed of all random values: the same seed gives the same figures.")
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Number of processes. [default: one for each core]", show_default=False),
]
SensorOption = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="Simulated sensor: a template's name, or a TOML file.")
]


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign evaluate precision -o precision --trials 10",
        "cmpdesign evaluate precision -o quick --trials 1",
    ),
)
def precision(
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places for every object and cube.")] = USUAL_TRIALS[
        "precision"
    ],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: PresetOption = "balanced",
) -> None:
    """Measure the error on five pressed objects, and the edge fitting error of a cube."""
    run = _run_experiment("precision", output, trials, seed, workers, sensor, preset)
    for mode, one in run.document["edge_fit_error_mm"].items():
        say(
            f"edge fitting error, {mode}: square {_format_number(one['square'])} mm, multicolor "
            f"{_format_number(one['multicolor'])} mm "
            f"({_format_percent(one['change_percent'])}; the article {_format_percent(one['article_change_percent'])})"
        )
    run.finish()


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign evaluate response -o response",
        "cmpdesign evaluate response -o quick --trials 1 --workers 1",
    ),
)
def response(
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places of the cube.")] = USUAL_TRIALS["response"],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: PresetOption = "balanced",
) -> None:
    """Measure the share of a shear that the markers under a cube show."""
    run = _run_experiment("response", output, trials, seed, workers, sensor, preset)
    for case, one in run.document["response"].items():
        say(
            f"response, {case}: square {_format_number(one['square'])}, multicolor {_format_number(one['multicolor'])} "
            f"({_format_percent(one['change_percent'])}; the article {_format_percent(one['article_change_percent'])})"
        )
    run.finish()


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign evaluate reliability -o reliability --trials 300",
        "cmpdesign evaluate reliability -o quick --trials 1 --seed 7",
    ),
)
def reliability(
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places and lights for every mode.")] = USUAL_TRIALS[
        "reliability"
    ],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: PresetOption = "balanced",
) -> None:
    """Count how often both patterns are read under a ball that presses, then twists or shears."""
    run = _run_experiment("reliability", output, trials, seed, workers, sensor, preset)
    for mode, methods in run.document["modes"].items():
        counts = ", ".join(f"{name} {one['successful']}" for name, one in methods.items())
        say(f"{mode}, of {trials}: {counts}")
    run.finish()


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign evaluate angles -o angles",
        "cmpdesign evaluate angles -o angles --workers 2 --json",
    ),
)
def angles(output: Output, workers: Workers = None) -> None:
    """Measure how far a single cell can deform or turn before the cell is lost, against eqs. 1 and 2."""
    run = _run_experiment("angles", output, USUAL_TRIALS["angles"], 0, workers, "tac3d", "balanced")
    for name, one in run.document["cells"].items():
        for what, limit in one.items():
            largest = list(limit["measured"])[-1]
            say(
                f"{name}, {what}: formula {limit['formula']:.1f}, first lost "
                f"{_format_number(limit['measured'][largest], 1)} "
                f"at {largest}"
            )
    run.finish()


@app.command(
    cls=Command,
    epilog=examples(
        "cmpdesign evaluate designs tac3d digit -o compared",
        "cmpdesign evaluate designs mine.toml honeycomb -o compared --trials 1",
    ),
)
def designs(
    design: Annotated[list[str], typer.Argument(metavar="DESIGN", help="Templates or TOML files.")],
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places and lights for every contact.")] = USUAL_TRIALS[
        "designs"
    ],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: PresetOption = "balanced",
) -> None:
    """Compare designs on one sensor: error, share measured, smallest feature, laser time."""
    run = _run_experiment("designs", output, trials, seed, workers, sensor, preset, _design_entries(design))
    for name, one in run.document["designs"].items():
        error = one["surface_rms_mm"]["mean"]
        shown = "nothing read" if error is None else f"surface {1000 * error:.1f} um RMS"
        say(
            f"{printable_path(name)}: {shown}, {100 * one['measured']['mean']:.1f} % measured, "
            f"smallest feature {one['smallest_feature_mm']:.3f} mm, laser {_format_number(one['laser_time_s'], 0)} s"
        )
    run.finish()


class _Run(NamedTuple):
    """The document of report.json, and the written files."""

    document: Mapping[str, Any]
    files: Sequence[Path]

    def finish(self) -> None:
        from cmpdesign.documents.runs import EvaluateDocument

        written = tuple(map(printable_path, self.files))
        finish(lambda: EvaluateDocument(written=written, report=dict(self.document)))


def _design_entries(designs: Sequence[str]) -> list[DesignEntry]:
    """Load designs under the stems of their names.

    Raises:
        CmpDesignError: two designs have the same name.
    """
    from cmpdesign.design.design import load_design
    from cmpdesign.evaluate.designs import design_entries

    names = [Path(name).stem for name in designs]
    for name in names:
        if names.count(name) > 1:
            raise CmpDesignError(f"two designs are called {name!r}; rename one of the files")
    return design_entries({name: load_design(given) for name, given in zip(names, designs, strict=True)})


def _run_experiment(
    name: str,
    output: Path,
    trials: int,
    seed: int,
    workers: int | None,
    sensor: str,
    preset: str,
    designs: Sequence[DesignEntry] = (),
) -> _Run:
    """Run an experiment and print the written files."""
    from cmpdesign.evaluate.experiments import find_experiment, run_experiment
    from cmpdesign.evaluate.runner import RunOptions
    from cmpdesign.evaluate.simulated.sensor import load_sensor

    options = RunOptions(trials, seed, load_sensor(sensor).text, preset, workers or os.cpu_count() or 1)
    try:
        document, files = run_experiment(find_experiment(name, designs), options, output, bar=_trials_bar)
    except KeyboardInterrupt:
        print_warning("interrupted; run the same command again to continue")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    for path in files:
        say(f"wrote {printable_path(path)}")
    return _Run(document, files)


def _trials_bar(title: str, total: int, done: int) -> AbstractContextManager[Callable[[str], None]]:
    print_step(f"{title}: {total} trials, {done} of them done by an earlier run")
    return progress_bar(title, total, done=done, unit="trials")


def _format_number(value: float | None, digits: int = 3) -> str:
    return "none" if value is None else f"{value:.{digits}f}"


def _format_percent(value: float | None) -> str:
    return "none" if value is None else f"{value:+.1f} %"
