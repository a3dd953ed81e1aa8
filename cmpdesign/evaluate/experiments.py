"""An experiment from the first trial to the report."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmpdesign import __version__
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluate.designs import DesignEntry
from cmpdesign.evaluate.journal import Journal
from cmpdesign.evaluate.report.page import Section, report_html
from cmpdesign.evaluate.runner import RunOptions, Trial, Work, run_trials

Figures = Callable[[Sequence[Trial], Sequence[Mapping[str, Any]]], dict[str, Any]]


@dataclass(frozen=True)
class Experiment:
    """One of the experiments.

    Attributes:
        name: of the command.
        title: of its report.
        trials: options -> what is tried.
        work: one trial's values -> its result.
        figures: trials and results -> the members of report.json.
        sections: report.json's document -> what the page shows of it.
    """

    name: str
    title: str
    trials: Callable[[RunOptions], list[Trial]]
    work: Work
    figures: Figures
    sections: Callable[[Mapping[str, Any]], list[Section]]


def find_experiment(name: str, designs: Sequence[DesignEntry] = ()) -> Experiment:
    """An experiment by its command's name; ``designs`` are those to compare.

    Raises:
        CmpDesignError: an unknown name.
    """
    from cmpdesign.evaluate import angles, precision, reliability, responses, sections
    from cmpdesign.evaluate import designs as comparison

    def kind(title: str, module: Any, show: Callable[[Mapping[str, Any]], list[Section]]) -> Experiment:
        return Experiment(name, title, module.trials, module.work, module.figures, show)

    if name == "precision":
        return kind("Precision", precision, sections.precision_sections)
    if name == "response":
        return kind("Response capability", responses, sections.response_sections)
    if name == "reliability":
        return kind("Reliability", reliability, sections.reliability_sections)
    if name == "angles":
        return kind("Angle thresholds", angles, sections.angle_sections)
    if name == "designs":
        return Experiment(
            name,
            "Designs compared",
            lambda options: comparison.trials(options, designs),
            comparison.work,
            lambda trials, results: comparison.figures(trials, results, designs),
            sections.design_sections,
        )
    raise CmpDesignError(f"{name}: no such experiment")


def run_experiment(
    one: Experiment, options: RunOptions, folder: Path, *, show: bool = True
) -> tuple[dict[str, Any], list[Path]]:
    """Run what is left to try, and write ``report.json`` and ``report.html``.

    Returns:
        The report's document, and the files written.

    Raises:
        CmpDesignError: the folder holds a run under other conditions, or a value out of range.
        OutputError: something cannot be written; the trials done are kept.
    """
    from cmpdesign.files.atomic import write_folder

    conditions = {"experiment": one.name, "version": __version__, **options.values}
    todo = one.trials(options)
    with Journal(folder, conditions) as journal:
        results = run_trials(one.work, todo, journal, workers=options.workers, title=one.name, show=show)
    document = {
        "format": "cmp-evaluation",
        "version": 1,
        "experiment": one.name,
        "generator": f"cmpdesign {__version__}",
        "seed": options.seed,
        "trials": options.trials,
        "preset": options.preset,
        **one.figures(todo, results),
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    html = report_html(one.title, one.sections(document))
    return document, write_folder(folder, {"report.json": text, "report.html": html})
