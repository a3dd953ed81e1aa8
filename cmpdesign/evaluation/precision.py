"""``evaluate precision``: five objects pressed by 2 mm, and the edge fitting error of a cube (section IV-B)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmpdesign.evaluation import article_results as article
from cmpdesign.evaluation.measures import pressed_cube as cube
from cmpdesign.evaluation.report.statistics import round_for_json, sample_statistics
from cmpdesign.evaluation.runner import RunOptions, Trial, trial_rng
from cmpdesign.evaluation.simulated.contacts import REST, ContactLoad, place_surface

OBJECTS = (REST, "ball", "ring", "cylinder", "rib", "wedge")
PRESS_MM, REACH_MM = 2.0, 4.0  # press, and largest distance from the pattern's middle in x and y
METHODS = cube.COMPARED_METHODS
EDGE_MODES = ("press", "press_diagonal", "press_turned", "press_shear")
MEASURES = (
    "surface_rms_mm", "depth_rms_mm", "marker_rms_mm", "marker_median_mm", "over_sigma", "over_sigma_median",
    "covered", "measured",
)  # fmt: skip
VARIANTS = ("read", "with_virtual", "perfect", "perfect_with_virtual")


def trials(options: RunOptions) -> list[Trial]:
    """The same number of positions for every object, and for the cube in both modes."""
    objects = [
        Trial(f"{name}-{i}", {**options.values, "object": name, "index": i})
        for name in OBJECTS
        for i in range(options.trials)
    ]
    return objects + cube_trials(EDGE_MODES, options)


def cube_trials(modes: Sequence[str], options: RunOptions) -> list[Trial]:
    """Trials of the pressed cube: the same number of positions for every mode."""
    return [
        Trial(f"cube-{mode}-{i}", {**options.values, "mode": mode, "index": i})
        for mode in modes
        for i in range(options.trials)
    ]


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """The errors of both patterns for one object or cube at one position."""
    if "mode" in values:
        return cube.work(values)
    from cmpdesign.evaluation.measures.surface_errors import measure_reconstruction
    from cmpdesign.evaluation.simulated.conditions import mean_conditions
    from cmpdesign.evaluation.simulated.instrument import instrument_for_method

    text = values["sensor"]
    rng = trial_rng(values["seed"], values["object"], values["index"])
    x, y = rng.uniform(-REACH_MM, REACH_MM, 2)
    surface = place_surface(text, ContactLoad(values["object"], PRESS_MM), (float(x), float(y)))
    seed = int(rng.integers(2**31))
    result: dict[str, Any] = {"centre_mm": [float(x), float(y)]}
    for method in METHODS:
        instrument = instrument_for_method(text, method, values["preset"])
        result[method] = measure_reconstruction(
            instrument, surface, mean_conditions(instrument.sensor.table.conditions), seed
        )
    return result


def figures(trials: Sequence[Trial], results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The members of report.json."""
    pairs = list(zip(trials, results, strict=True))
    shapes = {
        name: {
            method: _summarise_errors(
                [result[method] for trial, result in pairs if trial.values.get("object") == name]
            )
            for method in METHODS
        }
        for name in OBJECTS
    }
    edges = {
        mode: summarise_edge_errors(
            [result for trial, result in pairs if trial.values.get("mode") == mode], mode
        )
        for mode in EDGE_MODES
    }
    return {"shape_error_mm": shapes, "edge_fit_error_mm": edges}


def _summarise_errors(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {name: sample_statistics([result[name] for result in results]).to_json() for name in MEASURES}


def summarise_edge_errors(results: Sequence[Mapping[str, Any]], mode: str) -> dict[str, Any]:
    """The mean edge fitting error of both patterns, its distribution, and the results of variants."""
    document: dict[str, Any] = {}
    for method in METHODS:
        errors = edge_errors_mm(results, method, "read")
        document[method] = round_for_json(sample_statistics(errors).mean)
    document["change_percent"] = article.change_percent(document["square"], document["multicolor"])
    document["article_change_percent"] = article.EDGE_ERROR_CHANGE_PERCENT.get(mode)
    document["distribution"] = {
        method: {
            "error": sample_statistics(edge_errors_mm(results, method, "read")).to_json(),
            "side_mm": [
                round_for_json(entry[method]["read"]["side_mm"] or float("nan")) for entry in results
            ],
        }
        for method in METHODS
    }
    variants = {
        variant: {m: edge_errors_mm(results, m, variant) for m in METHODS} for variant in VARIANTS[1:]
    }
    for name, measure in (("mean_extent", "mean_extent_mm"), ("by_depth", "side_by_depth_mm")):
        variants[name] = {m: edge_errors_mm(results, m, "read", measure) for m in METHODS}
    document["variants"] = {
        name: {m: round_for_json(sample_statistics(errors).mean) for m, errors in entry.items()}
        for name, entry in variants.items()
    }
    for entry in document["variants"].values():
        entry["change_percent"] = article.change_percent(entry["square"], entry["multicolor"])
    return document


def edge_errors_mm(
    results: Sequence[Mapping[str, Any]], method: str, variant: str, measure: str = "side_mm"
) -> list[float]:
    """Absolute differences in mm between the fitted square's side and the cube's, where a square was fitted."""
    sides = [result[method][variant][measure] for result in results]
    return [abs(side - cube.CUBE_SIDE_MM) for side in sides if side is not None]
