"""Error against the exact bound, bias and calibration: patterns and surfaces, and sweeps over blur, noise and pitch.

Standard scene (640 x 480 px, 11 layers, edges of 20 px, turned by 7.3 degrees, blur 1 px, sRGB, noise 2/255) unless a
row states another value; inks, blur and noise are not given to the extractor. Errors are RMS per axis; the bound is the
exact Cramer-Rao bound of the same sRGB picture and markers. "inner" are the markers with all their gridlines. z is the
RMS error over the stated covariance per axis: 1 is right. The calibration of all markers and virtual markers follows
each table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.pooled import grouped, rms_of
from benchmarks.frame.published import Page
from benchmarks.frame.table import TEXT, Table
from benchmarks.suites.scenes import (
    SCENE_KINDS,
    WRONG_SHARE,
    SceneCase,
    bound_rms_px,
    cached_extractor,
    inner_markers,
    shortest_edges,
)
from benchmarks.suites.scoring.calibration import calibration_table, squared_distances, summarise
from benchmarks.suites.scoring.squares import (
    PictureSquares,
    calibrations_by_position,
    picture_squares,
)
from benchmarks.suites.scoring.wrong import wrong_markers
from cmpdesign.scene import render
from cmpdesign.scene.standard import STANDARD_SIZE
from extractor.presets import PRESETS

SEEDS, QUICK_SEEDS = 5, 2
# layers that fit the image at the larger edges
PITCHES = ((8.0, 11), (10.0, 11), (12.0, 11), (16.0, 11), (20.0, 11), (30.0, 7), (40.0, 5))
GROUPS: dict[str, tuple[SceneCase, ...]] = {
    "scenes": tuple(
        SceneCase(pattern, kind) for pattern in ("honeycomb", "round", "elliptical") for kind in SCENE_KINDS
    ),
    "blur": tuple(SceneCase(blur_px=blur) for blur in (0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)),
    "noise": tuple(SceneCase(noise=noise) for noise in (0.5, 1.0, 2.0, 4.0, 8.0, 12.0)),
    "pitch": tuple(SceneCase(pitch_px=pitch, layers=layers) for pitch, layers in PITCHES),
}
COLUMNS = {
    "case": TEXT, "preset": TEXT, "found": ".1%", "wrong": "d", "inner px": ".4f", "inner / bound": ".2f",
    "all px": ".4f", "all / bound": ".2f", "bias px": ".4f", "inner z": ".2f", "refine ms": ".1f",
}  # fmt: skip


@dataclass(frozen=True)
class AccuracyResult:
    """A preset on a case, over all noise seeds; see the module. ``wrong``: error above 0.3 of the shortest edge.

    ``z`` is of the inner markers.
    """

    group: str
    case: str
    preset: str
    found_share: float
    wrong: int
    inner_px: float
    inner_bound_px: float
    all_px: float
    all_bound_px: float
    bias_px: float
    z: float
    refine_ms: float


@dataclass(frozen=True)
class MeasuredCase:
    """A preset's result on a case, and its errors over covariances, one entry per noise seed."""

    result: AccuracyResult
    squares: tuple[PictureSquares, ...]


def case_name(group: str, case: SceneCase) -> str:
    """The name of a case in the tables of its group."""
    value = {"blur": f"blur {case.blur_px:g} px", "noise": f"noise {case.noise:g}/255"}
    value |= {"pitch": f"edges of {case.pitch_px:g} px", "scenes": f"{case.pattern}, {case.kind}"}
    return value[group]


def measure_case(group: str, case: SceneCase, seeds: int) -> Iterator[MeasuredCase]:
    """All presets on the same images."""
    scene = case.scene()
    inner = inner_markers(scene.layout)
    bounds = bound_rms_px(scene, inner, np.ones_like(inner))
    rendered = [render(replace(scene, seed=seed), size=STANDARD_SIZE) for seed in range(seeds)]
    visible = rendered[0].truth.visible
    true = rendered[0].truth.marker_xy_px
    tolerance_px = WRONG_SHARE * shortest_edges(scene.layout, true)
    for preset in PRESETS:
        extractor = cached_extractor(case, preset)
        read = [extractor.extract(picture.image) for picture in rendered]
        errors = np.array([markers.xy_px for markers in read]) - true
        wrong = [wrong_markers(markers, true, tolerance_px).any_kind & visible for markers in read]
        found = np.isfinite(errors[..., 0]) & visible
        good = found & inner
        inner_d2 = [
            squared_distances(error[chosen], markers.cov_px2[chosen])
            for error, markers, chosen in zip(errors, read, good, strict=True)
        ]
        result = AccuracyResult(
            group, case_name(group, case), preset, float(found[:, visible].mean()), int(np.sum(wrong)),
            rms_of(errors[good]), bounds[0], rms_of(errors[found]), bounds[1],
            float(abs(errors[good].mean(axis=0)).max()) if good.any() else float("nan"),
            summarise(inner_d2).z.value,
            float(np.min([markers.timings_ms.get("refine", np.nan) for markers in read])),
        )  # fmt: skip
        truths = [picture.truth for picture in rendered]
        yield MeasuredCase(result, tuple(map(picture_squares, read, truths)))


def results_table(title: str, results: Sequence[AccuracyResult]) -> Table:
    rows = [
        (
            r.case, r.preset, r.found_share, r.wrong, r.inner_px, r.inner_px / r.inner_bound_px, r.all_px,
            r.all_px / r.all_bound_px, r.bias_px, r.z, r.refine_ms,
        )
        for r in results
    ]  # fmt: skip
    return Table(title, COLUMNS, rows)


def markdown(results: Sequence[AccuracyResult]) -> str:
    """One row per case, columns per preset: error over the bound, and z."""
    columns = {"": TEXT, "bound px": ".4f"}
    for preset in PRESETS:
        columns |= {f"{preset}: of the bound": ".2f", f"{preset}: z": ".2f"}
    rows = []
    for name, some in grouped(results, "case").items():
        of_presets = [value for r in some for value in (r.inner_px / r.inner_bound_px, r.z)]
        rows.append((name, some[0].inner_bound_px, *of_presets, some[-1].bias_px))
    return Table("", columns | {"bias px": ".4f"}, rows).markdown()


def page(measured: Mapping[str, Any]) -> Page:
    """The tables of docs/explanation/accuracy.md from the content of docs/measured/accuracy.json."""
    results = [AccuracyResult(**row) for row in measured["results"]]
    return Page({f"accuracy-{group}": markdown([r for r in results if r.group == group]) for group in GROUPS})


def measure(quick: bool = False) -> Shown:
    """Two tables for every group of cases.

    Args:
        quick: few noises.
    """
    seeds = QUICK_SEEDS if quick else SEEDS
    results: list[AccuracyResult] = []
    calibrations: dict[str, Any] = {}
    for group, cases in GROUPS.items():
        of_group = [measured for case in cases for measured in measure_case(group, case, seeds)]
        own = [measured.result for measured in of_group]
        results += own
        yield results_table(f"{group}; sRGB pictures, {seeds} noises", own)
        stated = {
            preset: calibrations_by_position([squares for case in cases for squares in case.squares])
            for preset, cases in grouped(of_group, "result.preset").items()
        }
        named = {
            f"{preset}: {name}": one for preset, by_name in stated.items() for name, one in by_name.items()
        }
        yield calibration_table(f"{group}, calibration", named)
        calibrations[group] = {
            preset: {name: asdict(one) for name, one in by_name.items()} for preset, by_name in stated.items()
        }
    return Found({"seeds": seeds, "results": [asdict(one) for one in results], "calibration": calibrations})


main = Experiment("accuracy", measure, page)
main.run_as(__name__)
