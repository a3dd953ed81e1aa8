"""``evaluate response``: the share of a shear that the markers in contact show (Fig. 11b)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmpdesign.evaluation import article_results as article
from cmpdesign.evaluation.measures import pressed_cube as cube
from cmpdesign.evaluation.precision import cube_trials
from cmpdesign.evaluation.report.statistics import round_for_json, sample_statistics
from cmpdesign.evaluation.runner import RunOptions, Trial

METHODS = cube.COMPARED_METHODS
CASES = {"shear_x": "press_shear_x", "shear_y": "press_shear"}
work = cube.work


def trials(options: RunOptions) -> list[Trial]:
    """The same number of positions of the cube for both directions."""
    return cube_trials(tuple(CASES.values()), options)


def figures(trials: Sequence[Trial], results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The members of report.json: by direction, mean displacement of the edge points over the shear."""
    document: dict[str, Any] = {}
    for case, mode in CASES.items():
        of_mode = [r for t, r in zip(trials, results, strict=True) if t.values["mode"] == mode]
        means = {
            method: round_for_json(sample_statistics(response_values(of_mode, method, "read")).mean)
            for method in METHODS
        }
        others = {
            variant: {
                method: round_for_json(sample_statistics(response_values(of_mode, method, variant)).mean)
                for method in METHODS
            }
            for variant in ("with_virtual", "perfect")
        }
        for entry in others.values():
            entry["change_percent"] = article.change_percent(entry["square"], entry["multicolor"])
        document[case] = {
            **means,
            "change_percent": article.change_percent(means["square"], means["multicolor"]),
            "article_change_percent": article.RESPONSE_CHANGE_PERCENT[case],
            "distribution": {
                method: sample_statistics(response_values(of_mode, method, "read")).to_json()
                for method in METHODS
            },
            "variants": others,
        }
    return {"response": document}


def response_values(results: Sequence[Mapping[str, Any]], method: str, variant: str) -> list[float]:
    """The responses of a method, without trials that have none."""
    return [
        result[method][variant]["response"]
        for result in results
        if result[method][variant]["response"] is not None
    ]
