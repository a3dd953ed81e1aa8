"""The pictures of a trial, drawn once and kept as files: readers in other processes need no renderer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.ablation.provoking import provoking_cases
from benchmarks.suites.ablation.seen_views import traced_cases, view_cases
from benchmarks.suites.calibration.cases import CalibrationCase
from benchmarks.suites.calibration.suites import suites_by_name
from benchmarks.suites.scenes import shortest_edges, standard_layout
from benchmarks.suites.stress.conditions import BY_NAME
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame
from benchmarks.suites.stress.kinds import StressCase, make_frame
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout

POOLED = ("plain", "stress", "damage", "scatter", "camera", "views", "traced")
PROVOKING = "provoking"
GENERATED = {PROVOKING: provoking_cases, "views": view_cases, "traced": traced_cases}  # not drawn from all
RANDOM_DRAWS = 16  # pictures of random damage per kind and pattern


class PatternTruth(NamedTuple):
    """One pattern in a picture.

    Attributes:
        xy_px: (M, 2) float64, the true positions; NaN where not known.
        edge_px: (M,) float64, the shortest edge at each marker.
        visible: (M,) bool.
    """

    xy_px: NDArray[np.float64]
    edge_px: NDArray[np.float64]
    visible: NDArray[np.bool_]


class KeptPicture(NamedTuple):
    """A picture on disk.

    Attributes:
        suite, kind: suite and kind of the picture.
        path: the file that ``read_pictures`` of ``worker`` reads.
        truths: one entry for each pattern in the picture; none without a pattern.
    """

    suite: str
    kind: str
    path: Path
    truths: tuple[PatternTruth, ...]


def sampled_cases(suite: str, count: int, seed: int) -> list[CalibrationCase]:
    """``count`` pictures of a suite, drawn from all of its pictures by the seed; all pictures if the suite has
    fewer.
    """
    if suite in GENERATED:
        return list(islice(GENERATED[suite](seed), count))
    cases = list(suites_by_name()[suite](False, seed))
    if suite == "damage":
        cases += random_damage_cases(seed, RANDOM_DRAWS)
    chosen = np.random.default_rng([seed, 5]).permutation(len(cases))[:count]
    return [cases[number] for number in sorted(chosen)]


def random_damage_cases(seed: int, draws: int) -> list[CalibrationCase]:
    """Damage of any color and size on deformed surfaces, all kinds and patterns, as often as there are draws."""
    own = [
        StressCase(kind.name, kind.steps[0], pattern, (seed + 104729 * draw) % 2**31)
        for draw in range(draws)
        for kind in RANDOM_KINDS
        for pattern in PATTERNS
    ]
    frames = [make_frame(case, BY_NAME[case.kind]) for case in own]
    return [
        CalibrationCase(case.kind, standard_layout(case.pattern), frame.shoot)
        for case, frame in zip(own, frames, strict=True)
        if isinstance(frame, PatternFrame)
    ]


def keep_pictures(suite: str, count: int, seed: int, folder: Path) -> Iterator[KeptPicture]:
    """Draw the pictures of a suite, one after another, into files of the folder."""
    yield from keep_cases(suite, sampled_cases(suite, count, seed), f"{suite}-{seed}", folder)


def keep_cases(
    suite: str, cases: Iterable[CalibrationCase], stem: str, folder: Path
) -> Iterator[KeptPicture]:
    """Draw cases, one after another, into files of the folder whose names begin with the stem."""
    for number, case in enumerate(cases):
        shot = case.shoot()
        path = folder / f"{stem}-{number}.npz"
        np.savez(path, image=shot.image, layout=layout_to_json(case.layout))
        truths = tuple(
            pattern_truth(case.layout, truth.marker_xy_px, getattr(truth, "visible", None), shot.image.shape)
            for truth in shot.truths
        )
        yield KeptPicture(suite, case.kind, path, truths)


def pattern_truth(
    layout: Layout, xy_px: NDArray[np.float64], visible: NDArray[np.bool_] | None, shape: tuple[int, ...]
) -> PatternTruth:
    """The truth at the markers of the reader's layout; of a larger pattern around it, at its own markers only.

    Without ``visible`` all markers within the image are visible.
    """
    known_px = np.full((len(layout.marker_xy_mm), 2), np.nan)
    count = min(len(known_px), len(xy_px))
    known_px[:count] = xy_px[:count]
    seen = np.zeros(len(known_px), np.bool_)
    if visible is None:
        seen[:] = np.all((known_px >= -0.5) & (known_px < np.array(shape[1::-1]) - 0.5), axis=1)
    else:
        seen[:count] = visible[:count]
    return PatternTruth(known_px, shortest_edges(layout, known_px), seen)
