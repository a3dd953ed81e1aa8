"""``evaluate reliability``: how often a pattern is read under a ball that presses, then twists or shears (Table I)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.evaluate import article_results as article
from cmpdesign.evaluate.report.statistics import SuccessShare, sample_statistics
from cmpdesign.evaluate.runner import RunOptions, Trial, trial_rng
from cmpdesign.evaluate.simulated.contacts import ContactLoad, PlacedSurface, place_surface
from cmpdesign.evaluate.simulated.instrument import Instrument, instrument_for_method

if TYPE_CHECKING:
    from cmpdesign.evaluate.simulated.conditions import ImagingConditions
    from cmpdesign.scene import Rendered
    from cmpdesign.scene.truth import Truth
    from extractor import Markers

Points = NDArray[np.float64]
REACH_MM = 4.0  # the ball's centre lies within this of the pattern's middle, in x and y
CONTACT_LOADS = {
    "twist": ContactLoad("large_ball", 2.0, twist_deg=-30.0),
    "shear_x": ContactLoad("large_ball", 2.0, shear_mm=(1.5, 0.0)),
    "shear_y": ContactLoad("large_ball", 2.0, shear_mm=(0.0, 1.5)),
}
METHODS = ("square", "square_saddles", "multicolor_unrefined", "multicolor", "multicolor_repair")

# A marker belongs to the contact's area when it moves by at least this share of the largest movement.
CONTACT_DISPLACEMENT_SHARE = 0.1
# It is right when it lies this near to its true place, in edges at rest: far below the next marker's.
PLACE_TOLERANCE_EDGES = 0.25
SUCCESS_CRITERIA = {
    "strict": "in both views every visible marker of the contact's area has its number and its place, and nowhere does "
    "a marker have a wrong place",
    "area_95": "the same with 95 % of the visible markers of the contact's area",
    "no_wrong": "at least half of the visible markers of the contact's area, and nowhere a wrong place",
}
SUCCESS_DEFINITION = (
    f"Successful: {SUCCESS_CRITERIA['strict']}. A place is right within {PLACE_TOLERANCE_EDGES:g} edges "
    f"at rest of the true one; the "
    f"contact's area is where the surface has moved by at least {CONTACT_DISPLACEMENT_SHARE:.0%} of the "
    f"largest movement."
)


def trials(options: RunOptions) -> list[Trial]:
    """As many random positions and lights for every mode; the same ones for all patterns."""
    return [
        Trial(f"{mode}-{i}", {**options.values, "mode": mode, "index": i})
        for mode in CONTACT_LOADS
        for i in range(options.trials)
    ]


def work(values: Mapping[str, Any]) -> dict[str, Any]:
    """What each method reads of one contact."""
    from cmpdesign.evaluate.simulated.conditions import sample_conditions
    from extractor.result import Status

    text, mode = values["sensor"], values["mode"]
    random = trial_rng(values["seed"], mode, values["index"])
    x, y = random.uniform(-REACH_MM, REACH_MM, 2)
    pressed = place_surface(text, CONTACT_LOADS[mode], (float(x), float(y)))
    ranges = instrument_for_method(text, "square", values["preset"]).sensor.table.conditions
    drawn = sample_conditions(
        ranges, random, instrument_for_method(text, "square", values["preset"]).half_window_mm
    )
    seed = int(random.integers(2**31))

    found: dict[str, Any] = {}
    square, multicolor = (
        instrument_for_method(text, "square", values["preset"]),
        instrument_for_method(text, "multicolor", values["preset"]),
    )
    picture, dirty = _render_contact(square, drawn, seed, pressed)
    for method in ("square", "square_saddles"):
        read = instrument_for_method(text, method, values["preset"]).read(picture.image)
        found[method] = judge_places(square, pressed, picture.truth, np.stack([m.xy_px for m in read]))
    picture, dirty_too = _render_contact(multicolor, drawn, seed, pressed)
    read = multicolor.read(picture.image)
    places, status = np.stack([m.xy_px for m in read]), np.stack([m.status for m in read])
    measured = np.where((status == Status.MEASURED)[..., None], places, np.nan)
    found["multicolor_unrefined"] = judge_places(
        multicolor, pressed, picture.truth, unrefined_places_px(multicolor, read)
    )
    found["multicolor"] = judge_places(multicolor, pressed, picture.truth, measured)
    found["multicolor_repair"] = judge_places(multicolor, pressed, picture.truth, places)
    return {"methods": found, "centre_mm": [float(x), float(y)], "specks_drawn": bool(dirty and dirty_too)}


def unrefined_places_px(one: Instrument, read: Sequence[Markers]) -> Points:
    """(V, M, 2) the means of the triangles' corners, as the article has them: before this project's refinement."""
    found = np.full((len(read), len(one.layout.marker_xy_mm), 2), np.nan)
    for place, view, markers in zip(found, one.sensor.rig.views, read, strict=True):
        if "place" in markers.stages:
            place[:] = markers.stages["place"].xy_px + (view.area_px or (0, 0))[:2]
    return found


def _render_contact(
    one: Instrument, drawn: ImagingConditions, seed: int, pressed: PlacedSurface
) -> tuple[Rendered, bool]:
    """The picture; without the specks where the surface turns away from a camera, as dirt cannot be drawn there."""
    from dataclasses import replace

    from cmpdesign.scene import SceneError

    try:
        return one.picture(drawn, seed, pressed), True
    except SceneError:
        if drawn.damage is None:
            raise
        return one.picture(replace(drawn, damage=None), seed, pressed), False


def judge_places(one: Instrument, pressed: PlacedSurface, truth: Truth, places: Points) -> dict[str, Any]:
    """What is right and wrong of places (V, M, 2) read in all views together."""
    moved_mm = np.linalg.norm(pressed.displacement_mm(one.layout.marker_xy_mm), axis=1)
    area = moved_mm >= CONTACT_DISPLACEMENT_SHARE * moved_mm[one.layout.present].max()
    needed = np.asarray(truth.visible) & area
    away_px = np.linalg.norm(places - truth.marker_xy_px, axis=2)
    tolerance_px = PLACE_TOLERANCE_EDGES * one.edge_px
    known = np.isfinite(away_px)
    right = known & (away_px <= tolerance_px)
    rms_px = float(np.sqrt(np.mean(away_px[right] ** 2))) if right.any() else None
    return {
        "needed": int(needed.sum()),
        "right": int((needed & right).sum()),
        "wrong": int((known & ~right).sum()),
        "visible": int(np.asarray(truth.visible).sum()),
        "visible_right": int((np.asarray(truth.visible) & right).sum()),
        "rms_px": rms_px,
    }


def is_successful(criterion: str, one: Mapping[str, Any]) -> bool:
    """Whether a method's reading of one contact is successful, by a criterion of ``SUCCESS_CRITERIA``."""
    share = {"strict": 1.0, "area_95": 0.95, "no_wrong": 0.5}[criterion]
    return bool(one["wrong"] == 0 and one["right"] >= share * one["needed"])


def figures(trials: Sequence[Trial], results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """report.json's members."""
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


def _summarise_method(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    counts = {
        name: SuccessShare(len(found), sum(is_successful(name, one) for one in found)).to_json()
        for name in SUCCESS_CRITERIA
    }
    return {
        **counts["strict"],
        "by_criterion": counts,
        "right_in_area_percent": sample_statistics(
            [100 * one["right"] / max(one["needed"], 1) for one in found]
        ).to_json(),
        "wrong_markers": sum(one["wrong"] for one in found),
        "trials_with_wrong": sum(one["wrong"] > 0 for one in found),
        "rms_px": sample_statistics([one["rms_px"] for one in found]).to_json(),
    }
