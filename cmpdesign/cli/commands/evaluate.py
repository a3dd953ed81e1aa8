"""``cmpdesign evaluate``: the article's experiments on a simulated sensor, and designs compared."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from cmpdesign.api import workshop
from cmpdesign.cli.command import Command, examples, new_group
from cmpdesign.cli.derived import derived
from cmpdesign.cli.options.completions import COMPLETIONS
from cmpdesign.cli.progress import working
from cmpdesign.cli.terminal import EXIT_INTERRUPTED, finish, print_warning, printable_path, say
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluation.defaults import USUAL_TRIALS
from cmpdesign.watch import watched

app = new_group(
    "Repeat the article's experiments on a simulated sensor, and compare designs.\n\nWrites report.html and "
    "report.json. The same command continues an interrupted run.",
    "cmpdesign evaluate precision -o quick --trials 1",
    "cmpdesign evaluate designs tac3d digit -o compared",
)

DesignsArgument = Annotated[
    list[str],
    typer.Argument(metavar="DESIGN", help="Templates or TOML files.", autocompletion=COMPLETIONS["designs"]),
]
DesignTrials = Annotated[int, typer.Option(min=1, help="Places and lights for every contact.")]
OWN: dict[str, None] = dict.fromkeys(("experiment", "designs", "trials"))
Report = Mapping[str, Any]
Show = Callable[[Report], Iterator[str]]


def _precision(report: Report) -> Iterator[str]:
    """Measure the error on five pressed objects, and the edge fitting error of a cube."""
    for mode, one in report["edge_fit_error_mm"].items():
        yield (
            f"edge fitting error, {mode}: square {_number(one['square'])} mm, multicolor "
            f"{_number(one['multicolor'])} mm "
            f"({_percent(one['change_percent'])}; the article {_percent(one['article_change_percent'])})"
        )


def _response(report: Report) -> Iterator[str]:
    """Measure the share of a shear that the markers under a cube show."""
    for case, one in report["response"].items():
        yield (
            f"response, {case}: square {_number(one['square'])}, multicolor {_number(one['multicolor'])} "
            f"({_percent(one['change_percent'])}; the article {_percent(one['article_change_percent'])})"
        )


def _reliability(report: Report) -> Iterator[str]:
    """Count how often both patterns are read under a ball that presses, then twists or shears."""
    for mode, methods in report["modes"].items():
        counts = ", ".join(f"{name} {one['successful']}" for name, one in methods.items())
        yield f"{mode}, of {report['trials']}: {counts}"


def _angles(report: Report) -> Iterator[str]:
    """Measure how far a single cell can deform or turn before the cell is lost, against eqs. 1 and 2."""
    for name, one in report["cells"].items():
        for what, limit in one.items():
            largest = list(limit["measured"])[-1]
            lost = _number(limit["measured"][largest], 1)
            yield f"{name}, {what}: formula {limit['formula']:.1f}, first lost {lost} at {largest}"


def _designs(report: Report) -> Iterator[str]:
    """Compare designs on one sensor: error, share measured, smallest feature, laser time."""
    for name, one in report["designs"].items():
        error = one["surface_rms_mm"]["mean"]
        shown = "nothing read" if error is None else f"surface {1000 * error:.1f} um RMS"
        yield (
            f"{printable_path(name)}: {shown}, {100 * one['measured']['mean']:.1f} % measured, "
            f"smallest feature {one['smallest_feature_mm']:.3f} mm, laser {_number(one['laser_time_s'], 0)} s"
        )


def _add(name: str, show: Show, trials_text: str, *shown: str) -> None:
    """Add the command of an experiment; ``show`` gives its lines, and its docstring is the help."""

    def command(output: Path, *, trials: int = USUAL_TRIALS[name], **options: Any) -> None:
        _run(name, show, output, trials=trials, **options)

    command.__annotations__["trials"] = Annotated[int, typer.Option(min=1, help=trials_text)]
    _register(command, name, show, shown, **OWN)


def _register(command: Any, name: str, show: Show, shown: Sequence[str], **own: None) -> None:
    ready = derived(workshop.evaluate, "", **own)(command)
    ready.__doc__ = show.__doc__
    app.command(name, cls=Command, epilog=examples(*shown))(ready)


_add(
    "precision",
    _precision,
    "Places for every object and cube.",
    "cmpdesign evaluate precision -o precision --trials 10",
    "cmpdesign evaluate precision -o quick --trials 1",
)
_add(
    "response",
    _response,
    "Places of the cube.",
    "cmpdesign evaluate response -o response",
    "cmpdesign evaluate response -o quick --trials 1 --workers 1",
)
_add(
    "reliability",
    _reliability,
    "Places and lights for every mode.",
    "cmpdesign evaluate reliability -o reliability --trials 300",
    "cmpdesign evaluate reliability -o quick --trials 1 --seed 7",
)


def angles(output: Path, **options: Any) -> None:
    _run("angles", _angles, output, **options)


def designs(
    output: Path,
    *,
    design: DesignsArgument,
    trials: DesignTrials = USUAL_TRIALS["designs"],
    **options: Any,
) -> None:
    _run("designs", _designs, output, _loaded(design), trials=trials, **options)


_register(
    angles,
    "angles",
    _angles,
    ("cmpdesign evaluate angles -o angles", "cmpdesign evaluate angles -o angles --workers 2 --json"),
    **OWN,
    **dict.fromkeys(("seed", "sensor", "preset")),
)
_register(
    designs,
    "designs",
    _designs,
    (
        "cmpdesign evaluate designs tac3d digit -o compared",
        "cmpdesign evaluate designs mine.toml honeycomb -o compared --trials 1",
    ),
    **OWN,
)


def _loaded(designs: Sequence[str]) -> dict[str, Any]:
    """Load designs under the stems of their names.

    Raises:
        CmpDesignError: two designs have the same name.
    """
    from cmpdesign.design.design import load_design

    names = [Path(name).stem for name in designs]
    for name in names:
        if names.count(name) > 1:
            raise CmpDesignError(f"two designs are called {name!r}; rename one of the files")
    return {name: load_design(given) for name, given in zip(names, designs, strict=True)}


def _run(name: Any, show: Show, output: Path, designs: Any = None, **options: Any) -> None:
    """Run an experiment; print the written files and the lines."""
    try:
        with working(name) as steps, watched(steps.tell):
            found = workshop.evaluate(name, output, designs, **options)
    except KeyboardInterrupt:
        print_warning("interrupted; run the same command again to continue")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    for path in found.written:
        say(f"wrote {printable_path(path)}")
    for line in show(found.report):
        say(line)
    finish(lambda: found)


def _number(value: float | None, digits: int = 3) -> str:
    return "none" if value is None else f"{value:.{digits}f}"


def _percent(value: float | None) -> str:
    return "none" if value is None else f"{value:+.1f} %"
