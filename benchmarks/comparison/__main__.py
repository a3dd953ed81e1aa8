"""Speed against error: the presets, other detectors of corners, and the article's method, on the same scenes.

640 x 480 px, edges of 20 px, rotated by 7.3 degrees, blur 1 px in light, sRGB, noise 2/255 after it: honeycomb with 397
markers flat, tilted by 35 degrees, bulged, twisted, blurred by 1.6 px, with edges of 13 px; round and elliptical
patterns flat. Detectors of checkerboards read a board of 400 inner corners with the same edge length, camera, surface
and response, in black and white only, as a gray image. Bounds are the exact bounds of the encoded picture.
One thread each, processor time. The repetitions of all methods alternate, each with its own noise. Before every timed
frame a method reads another frame, not timed, as in a stream. The article's method is in plain Python where no stage of
the extractor does the same, so its time is an upper bound.

The pooled table is over three patterns, flat, with edges of 13 px, tilted, bulged and twisted, at blurs of 1 and
1.6 px; boards have no patterns. RMS of all markers' errors over RMS of their exact bounds, and the same over "inner"
markers, those with all their gridlines; z is the square root of the mean of e' C^-1 e / 2 for an error e and its stated
covariance C: 1 is right. ``--response linear`` measures the same scenes on linear pictures.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Literal

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.suites.comparison.measure import (
    CASES,
    MethodResult,
    measure_case,
    measure_pooled,
    pooled_cases,
)
from benchmarks.suites.comparison.report import page, pooled_table, scene_table

REPETITIONS, QUICK_REPETITIONS = 11, 3
POOLED_SEEDS, QUICK_POOLED_SEEDS = 4, 1


def measure(quick: bool = False, response: Literal["srgb", "linear"] = "srgb") -> Shown:
    """One table per scene, and one of all scenes together.

    Args:
        quick: few repetitions.
        response: of all pictures.
    """
    repetitions = QUICK_REPETITIONS if quick else REPETITIONS
    results: list[MethodResult] = []
    caption = f"{response} pictures, {repetitions} repetitions; the article's time is an upper bound"
    for case in CASES:
        results += measure_case(replace(case, response=response), repetitions)
        yield scene_table(case.name, results, caption)
    seeds = QUICK_POOLED_SEEDS if quick else POOLED_SEEDS
    pooled = measure_pooled(pooled_cases(response), seeds)
    yield pooled_table(pooled, f"{response} pictures, {seeds} noises a scene")
    record = {"results": [asdict(one) for one in results], "pooled": [asdict(one) for one in pooled]}
    return Found({"response": response, "repetitions": repetitions, **record})


main = Experiment("comparison", measure, page)
main.run_as(__name__)
