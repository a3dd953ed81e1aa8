"""The experiments, from the first trial to the report."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmpdesign import __version__
from cmpdesign.errors import CmpDesignError
from cmpdesign.evaluation.designs import DesignEntry
from cmpdesign.evaluation.journal import Journal
from cmpdesign.evaluation.report.page import Section, report_html
from cmpdesign.evaluation.runner import RunOptions, Trial, Work, run_trials
from cmpdesign.libraries import require_libraries

Figures = Callable[[Sequence[Trial], Sequence[Mapping[str, Any]]], dict[str, Any]]


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    Attributes:
        name: the command's name.
        title: the report's title.
        trials: options -> trials.
        work: one trial's values -> its result.
        figures: trials and results -> the members of report.json.
        sections: report.json's document -> the sections of the page.
    """

    name: str
    title: str
    trials: Callable[[RunOptions], list[Trial]]
    work: Work
    figures: Figures
    sections: Callable[[Mapping[str, Any]], list[Section]]


def find_experiment(name: str, designs: Sequence[DesignEntry] = ()) -> Experiment:
    """An experiment by its command's name; ``designs`` are the designs to compare.

    Raises:
        CmpDesignError: the name is unknown.
    """
    from cmpdesign.evaluation import angles, precision, reliability, responses, sections
    from cmpdesign.evaluation import designs as comparison

    def make(
        title: str, module: Any, page_sections: Callable[[Mapping[str, Any]], list[Section]]
    ) -> Experiment:
        return Experiment(name, title, module.trials, module.work, module.figures, page_sections)

    if name == "precision":
        return make("Precision", precision, sections.precision_sections)
    if name == "response":
        return make("Response capability", responses, sections.response_sections)
    if name == "reliability":
        return make("Reliability", reliability, sections.reliability_sections)
    if name == "angles":
        return make("Angle thresholds", angles, sections.angle_sections)
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
    experiment: Experiment, options: RunOptions, folder: Path
) -> tuple[dict[str, Any], list[Path]]:
    """Run the open trials, and write ``report.json`` and ``report.html``.

    Args:
        experiment: the experiment.
        options: the user's options.
        folder: folder of the journal and the report.

    Returns:
        The report's document, and the written files.

    Raises:
        MissingLibraryError: a library of the extra [evaluate] is not installed.
        CmpDesignError: the folder holds a run under other conditions, or a value is out of range.
        OutputError: a file cannot be written; finished trials are kept.
    """
    from cmpdesign.files.atomic import write_folder

    require_libraries("evaluate", "matplotlib", "scipy", "threadpoolctl")
    conditions = {"experiment": experiment.name, "version": __version__, **options.values}
    trials = experiment.trials(options)
    with Journal(folder, conditions) as journal:
        results = run_trials(experiment.work, trials, journal, workers=options.workers)
    document = {
        "format": "cmp-evaluation",
        "version": 1,
        "experiment": experiment.name,
        "generator": f"cmpdesign {__version__}",
        "seed": options.seed,
        "trials": options.trials,
        "preset": options.preset,
        **experiment.figures(trials, results),
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    html = report_html(experiment.title, experiment.sections(document))
    return document, write_folder(folder, {"report.json": text, "report.html": html})
