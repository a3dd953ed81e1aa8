"""``cmpdesign evaluate``: the article's experiments on a simulated sensor, and designs compared."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmpdesign.cli.command import Command
from cmpdesign.cli.terminal import EXIT_INTERRUPTED, console, print_warning, printable_path
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluate.defaults import PRESETS, USUAL_TRIALS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cmpdesign.evaluate.designs import DesignEntry


app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Repeat the article's experiments on a simulated sensor, and compare designs. Writes report.html and "
    "report.json; an interrupted run goes on where it stopped.",
)

Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the report and the journal.")
]
Seed = Annotated[int, typer.Option(min=0, help="Of everything random: the same seed gives the same figures.")]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes. [default: one for each core]", show_default=False)
]
SensorOption = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="Simulated sensor: shipped, or a TOML file.")
]
Preset = Annotated[str, typer.Option(metavar="NAME", help=f"The extractor's preset: {', '.join(PRESETS)}.")]


@app.command(cls=Command)
def precision(
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places for every object and cube.")] = USUAL_TRIALS[
        "precision"
    ],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: Preset = "balanced",
) -> None:
    """Five pressed objects against the truth, and the edge fitting error of a cube."""
    document = _run_experiment("precision", output, trials, seed, workers, sensor, preset)
    for mode, one in document["edge_fit_error_mm"].items():
        console().print(
            f"edge fitting error, {mode}: square {_format_number(one['square'])} mm, multicolor "
            f"{_format_number(one['multicolor'])} mm "
            f"({_format_percent(one['change_percent'])}; the article {_format_percent(one['article_change_percent'])})"
        )


@app.command(cls=Command)
def response(
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places of the cube.")] = USUAL_TRIALS["response"],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: Preset = "balanced",
) -> None:
    """How much of a shear the markers under a cube show."""
    document = _run_experiment("response", output, trials, seed, workers, sensor, preset)
    for case, one in document["response"].items():
        console().print(
            f"response, {case}: square {_format_number(one['square'])}, multicolor {_format_number(one['multicolor'])} "
            f"({_format_percent(one['change_percent'])}; the article {_format_percent(one['article_change_percent'])})"
        )


@app.command(cls=Command)
def reliability(
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places and lights for every mode.")] = USUAL_TRIALS[
        "reliability"
    ],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: Preset = "balanced",
) -> None:
    """How often both patterns are read under a ball that presses, then twists or shears."""
    document = _run_experiment("reliability", output, trials, seed, workers, sensor, preset)
    for mode, methods in document["modes"].items():
        counts = ", ".join(f"{name} {one['successful']}" for name, one in methods.items())
        console().print(f"{mode}, of {trials}: {counts}")


@app.command(cls=Command)
def angles(output: Output, workers: Workers = None) -> None:
    """How far a single cell may deform or turn before it is lost, against eqs. 1 and 2."""
    document = _run_experiment("angles", output, USUAL_TRIALS["angles"], 0, workers, "tac3d", "balanced")
    for name, one in document["cells"].items():
        for what, limit in one.items():
            largest = list(limit["measured"])[-1]
            console().print(
                f"{name}, {what}: formula {limit['formula']:.1f}, first lost "
                f"{_format_number(limit['measured'][largest], 1)} "
                f"at {largest}"
            )


@app.command(cls=Command)
def designs(
    design: Annotated[list[str], typer.Argument(metavar="DESIGN...", help="Templates or TOML files.")],
    output: Output,
    trials: Annotated[int, typer.Option(min=1, help="Places and lights for every contact.")] = USUAL_TRIALS[
        "designs"
    ],
    seed: Seed = 0,
    workers: Workers = None,
    sensor: SensorOption = "tac3d",
    preset: Preset = "balanced",
) -> None:
    """Score any designs on one sensor: error, share measured, smallest feature, laser time."""
    document = _run_experiment(
        "designs", output, trials, seed, workers, sensor, preset, _design_entries(design)
    )
    for name, one in document["designs"].items():
        error = one["surface_rms_mm"]["mean"]
        shown = "nothing read" if error is None else f"surface {1000 * error:.1f} um RMS"
        console().print(
            f"{printable_path(name)}: {shown}, {100 * one['measured']['mean']:.1f} % measured, "
            f"smallest feature {one['smallest_feature_mm']:.3f} mm, laser {_format_number(one['laser_time_s'], 0)} s"
        )


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
) -> Mapping[str, Any]:
    """Run an experiment and print the written files; the document of the report."""
    from cmpdesign.evaluate.experiments import find_experiment, run_experiment
    from cmpdesign.evaluate.runner import RunOptions
    from cmpdesign.evaluate.simulated.sensor import load_sensor

    if preset not in PRESETS:
        raise CmpDesignError(f"--preset {preset}: unknown; there are {', '.join(PRESETS)}")
    options = RunOptions(trials, seed, load_sensor(sensor).text, preset, workers or os.cpu_count() or 1)
    try:
        document, files = run_experiment(find_experiment(name, designs), options, output)
    except KeyboardInterrupt:
        print_warning("interrupted; the same command goes on where it stopped")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    for path in files:
        console().print(f"wrote {printable_path(path)}")
    return document


def _format_number(value: float | None, digits: int = 3) -> str:
    return "none" if value is None else f"{value:.{digits}f}"


def _format_percent(value: float | None) -> str:
    return "none" if value is None else f"{value:+.1f} %"
