"""Speed against error: the presets, other detectors of corners, and the article's method, on the same scenes.

    python -m benchmarks.comparison [--quick] [--response srgb|linear] [--json FILE] [--publish]

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

import os
import sys
from dataclasses import asdict, replace

# before numpy and chess-corners: times are of one core
os.environ["OMP_NUM_THREADS"] = os.environ["RAYON_NUM_THREADS"] = "1"

import cv2

from benchmarks.suites.comparison.measure import CASES, MethodResult, measure_case
from benchmarks.suites.comparison.pooled import measure_pooled, pooled_cases
from benchmarks.suites.comparison.report import (
    comparison_markdown,
    pooled_markdown,
    pooled_table,
    scene_table,
)
from benchmarks.support.command import publishing_parser, wide_console
from benchmarks.support.machine import conditions_text, write_json
from benchmarks.support.published import write_published

REPETITIONS, QUICK_REPETITIONS = 11, 3
POOLED_SEEDS, QUICK_POOLED_SEEDS = 4, 1


def main(arguments: list[str] | None = None) -> int:
    """Measure, print one table per scene; write the JSON file or the documentation on request."""
    parser = publishing_parser("comparison", __doc__, "repetitions")
    parser.add_argument("--response", choices=("srgb", "linear"), default="srgb", help="of all pictures")
    options = parser.parse_args(arguments)
    if options.publish and options.response != "srgb":
        parser.error("--publish writes the figures of sRGB pictures; leave --response out")
    cv2.setNumThreads(1)
    repetitions = QUICK_REPETITIONS if options.quick else REPETITIONS
    console = wide_console(150)
    results: list[MethodResult] = []
    caption = f"{options.response} pictures, {repetitions} repetitions; the article's time is an upper bound"
    for case in CASES:
        results += measure_case(replace(case, response=options.response), repetitions)
        console.print(scene_table(case.name, results, caption))
    seeds = QUICK_POOLED_SEEDS if options.quick else POOLED_SEEDS
    pooled = measure_pooled(pooled_cases(options.response), seeds)
    console.print(pooled_table(pooled, f"{options.response} pictures, {seeds} noises a scene"))
    console.print(conditions_text(), style="dim", soft_wrap=True)
    found = {
        "response": options.response,
        "repetitions": repetitions,
        "results": [asdict(result) for result in results],
        "pooled": [asdict(result) for result in pooled],
    }
    if options.json:
        write_json(options.json, found)
    if options.publish:
        blocks = {
            "comparison": comparison_markdown(results),
            "comparison-pooled": pooled_markdown(pooled),
            "conditions": conditions_text(),
        }
        for path in write_published("comparison", found, blocks):
            console.print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
