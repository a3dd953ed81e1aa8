"""``evaluate reliability``: share of successful readings under a ball that presses, then twists or shears (Table I).

Every method reads the same contacts. A reading is compared with the truth of the rendered picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluation import article_results as article
from cmpdesign.evaluation.report.statistics import SuccessShare, sample_statistics
from cmpdesign.evaluation.runner import RunOptions, Trial, trial_rng
from cmpdesign.evaluation.simulated.contacts import ContactLoad, PlacedSurface, place_surface
from cmpdesign.evaluation.simulated.instrument import Instrument, instrument_for_method

if TYPE_CHECKING:
    from cmpdesign.evaluation.simulated.conditions import ImagingConditions
    from cmpdesign.scene import Rendered
    from cmpdesign.scene.truth import Truth
    from extractor import Markers

Points = NDArray[np.float64]
REACH_MM = 4.0  # largest distance of the ball's centre from the pattern's middle, in x and y
CONTACT_LOADS = {
    "twist": ContactLoad("large_ball", 2.0, twist_deg=-30.0),
    "shear_x": ContactLoad("large_ball", 2.0, shear_mm=(1.5, 0.0)),
    "shear_y": ContactLoad("large_ball", 2.0, shear_mm=(0.0, 1.5)),
}
METHODS = ("square", "square_saddles", "multicolor_unrefined", "multicolor", "multicolor_repair")

# A marker belongs to the contact's area when its displacement is at least this share of the largest displacement.
CONTACT_DISPLACEMENT_SHARE = 0.1
# A marker is right within this distance of its true position, in edges at rest.
PLACE_TOLERANCE_EDGES = 0.25
SUCCESS_CRITERIA = {
    "strict": "in both views every visible marker of the contact's area has its number and its place, and no "
    "marker has a wrong place",
    "area_95": "the same with 95 % of the visible markers of the contact's area",
    "no_wrong": "at least half of the visible markers of the contact's area, and no wrong place",
}
SUCCESS_DEFINITION = (
    f"Successful: {SUCCESS_CRITERIA['strict']}. A place is right within {PLACE_TOLERANCE_EDGES:g} edges "
    f"at rest of the true one; the "
    f"contact's area is where the surface has moved by at least {CONTACT_DISPLACEMENT_SHARE:.0%} of the "
    f"largest movement."
)


def trials(options: RunOptions) -> list[Trial]:
    """The same number of random positions and lights for every mode, equal for all patterns."""
    return [
        Trial(f"{mode}-{i}", {**options.values, "mode": mode, "index": i})
        for mode in CONTACT_LOADS
        for i in range(options.trials)
    ]


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """The judged readings of one contact by all methods."""
    from cmpdesign.evaluation.simulated.conditions import sample_conditions
    from extractor.result import Status

    text, mode = values["sensor"], values["mode"]
    rng = trial_rng(values["seed"], mode, values["index"])
    x, y = rng.uniform(-REACH_MM, REACH_MM, 2)
    surface = place_surface(text, CONTACT_LOADS[mode], (float(x), float(y)))
    ranges = instrument_for_method(text, "square", values["preset"]).sensor.table.conditions
    conditions = sample_conditions(
        ranges, rng, instrument_for_method(text, "square", values["preset"]).half_window_mm
    )
    seed = int(rng.integers(2**31))

    judged: dict[str, Any] = {}
    square, multicolor = (
        instrument_for_method(text, "square", values["preset"]),
        instrument_for_method(text, "multicolor", values["preset"]),
    )
    picture, specks_on_square = _render_contact(square, conditions, seed, surface)
    for method in ("square", "square_saddles"):
        read = instrument_for_method(text, method, values["preset"]).read(picture.image)
        judged[method] = judge_places(square, surface, picture.truth, np.stack([m.xy_px for m in read]))
    picture, specks_on_multicolor = _render_contact(multicolor, conditions, seed, surface)
    read = multicolor.read(picture.image)
    places, status = np.stack([m.xy_px for m in read]), np.stack([m.status for m in read])
    measured = np.where((status == Status.MEASURED)[..., None], places, np.nan)
    judged["multicolor_unrefined"] = judge_places(
        multicolor, surface, picture.truth, unrefined_places_px(multicolor, read)
    )
    judged["multicolor"] = judge_places(multicolor, surface, picture.truth, measured)
    judged["multicolor_repair"] = judge_places(multicolor, surface, picture.truth, places)
    return {
        "methods": judged,
        "centre_mm": [float(x), float(y)],
        "specks_drawn": bool(specks_on_square and specks_on_multicolor),
    }


def unrefined_places_px(instrument: Instrument, read: Sequence[Markers]) -> Points:
    """(V, M, 2) px: the means of the triangles' corners, as in the article, before this project's refinement."""
    xy_px = np.full((len(read), len(instrument.layout.marker_xy_mm), 2), np.nan)
    for view_xy_px, view, markers in zip(xy_px, instrument.sensor.rig.views, read, strict=True):
        if "place" in markers.stages:
            view_xy_px[:] = markers.stages["place"].xy_px + (view.area_px or (0, 0))[:2]
    return xy_px


def _render_contact(
    instrument: Instrument, conditions: ImagingConditions, seed: int, surface: PlacedSurface
) -> tuple[Rendered, bool]:
    """The picture, and whether its specks are drawn: not where the surface turns away from a camera."""
    from dataclasses import replace

    from cmpdesign.scene import SceneError

    try:
        return instrument.picture(conditions, seed, surface), True
    except SceneError:
        if conditions.damage is None:
            raise
        return instrument.picture(replace(conditions, damage=None), seed, surface), False


def judge_places(
    instrument: Instrument, surface: PlacedSurface, truth: Truth, places: Points
) -> dict[str, Any]:
    """Counts of right and wrong markers in all views together.

    Args:
        instrument: the pattern on its sensor.
        surface: the deformed surface.
        truth: the picture's truth.
        places: (V, M, 2) px, the read positions, NaN where lost.
    """
    displacement_mm = np.linalg.norm(surface.displacement_mm(instrument.layout.marker_xy_mm), axis=1)
    area = displacement_mm >= CONTACT_DISPLACEMENT_SHARE * displacement_mm[instrument.layout.present].max()
    needed = np.asarray(truth.visible) & area
    error_px = np.linalg.norm(places - truth.marker_xy_px, axis=2)
    tolerance_px = PLACE_TOLERANCE_EDGES * instrument.edge_px
    known = np.isfinite(error_px)
    right = known & (error_px <= tolerance_px)
    rms_px = float(np.sqrt(np.mean(error_px[right] ** 2))) if right.any() else None
    return {
        "needed": int(needed.sum()),
        "right": int((needed & right).sum()),
        "wrong": int((known & ~right).sum()),
        "visible": int(np.asarray(truth.visible).sum()),
        "visible_right": int((np.asarray(truth.visible) & right).sum()),
        "rms_px": rms_px,
    }


def is_successful(criterion: str, judged: Mapping[str, Any]) -> bool:
    """Whether a judged reading of one contact is successful by a criterion of ``SUCCESS_CRITERIA``."""
    share = {"strict": 1.0, "area_95": 0.95, "no_wrong": 0.5}[criterion]
    return bool(judged["wrong"] == 0 and judged["right"] >= share * judged["needed"])


def figures(trials: Sequence[Trial], results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The members of report.json."""
    modes: dict[str, Any] = {}
    for mode in CONTACT_LOADS:
        found = [r for t, r in zip(trials, results, strict=True) if t.values["mode"] == mode]
        modes[mode] = {method: _summarise_method([r["methods"][method] for r in found]) for method in METHODS}
        for method, successes in article.ARTICLE_SUCCESSES[mode].items():
            modes[mode][method]["article"] = SuccessShare(article.ARTICLE_TRIALS, successes).to_json()
    undrawn = sum(not result["specks_drawn"] for result in results)
    return {
        "definition": SUCCESS_DEFINITION,
        "criteria": SUCCESS_CRITERIA,
        "modes": modes,
        "trials_without_specks": undrawn,
    }


def _summarise_method(readings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    counts = {
        name: SuccessShare(len(readings), sum(is_successful(name, judged) for judged in readings)).to_json()
        for name in SUCCESS_CRITERIA
    }
    return {
        **counts["strict"],
        "by_criterion": counts,
        "right_in_area_percent": sample_statistics(
            [100 * judged["right"] / max(judged["needed"], 1) for judged in readings]
        ).to_json(),
        "wrong_markers": sum(judged["wrong"] for judged in readings),
        "trials_with_wrong": sum(judged["wrong"] > 0 for judged in readings),
        "rms_px": sample_statistics([judged["rms_px"] for judged in readings]).to_json(),
    }
