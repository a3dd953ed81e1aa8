"""Every method on every scene, with interleaved repetitions, so that the machine's load affects all methods equally."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.suites.comparison.methods import METHODS, REFERENCE_METHOD, Method
from benchmarks.suites.scenes import (
    SCENE_KINDS,
    WRONG_SHARE,
    SceneCase,
    bound_rms_px,
    inner_markers,
    shortest_edges,
)
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Rendered, Scene, render
from cmpdesign.scene.standard import STANDARD_SIZE

WIDE_BLUR_PX, SMALL_PITCH_PX = 1.6, 13.0
CASES = (
    *(SceneCase(kind=kind) for kind in SCENE_KINDS),
    SceneCase(blur_px=WIDE_BLUR_PX),
    SceneCase(pitch_px=SMALL_PITCH_PX),
    SceneCase("round"),
    SceneCase("elliptical"),
)


@dataclass(frozen=True)
class MethodResult:
    """A method in a scene. Errors in px, RMS per axis, over found markers; wrong markers are counted, not averaged.

    Attributes:
        found_share: share of the markers in view; of the board's inner corners.
        wrong: in all repetitions, markers with an error above 0.3 of an edge, and points where there is no marker.
        bias_px: the mean error, the larger of both axes.
        inner_px, bound_px: over markers with all their gridlines; the bound of the pattern that was read.
        ms: median processor time; ``ratio``: median ratio to the reference's time in the same repetition.
    """

    method: str
    scene: str
    found_share: float
    wrong: int
    all_px: float
    inner_px: float
    bias_px: float
    all_bound_px: float
    bound_px: float
    ms: float
    ratio: float


class RequiredMarkers(NamedTuple):
    """(M,) bool: the markers that a method should find, and those of them with all their gridlines."""

    every: NDArray[np.bool_]
    inner: NDArray[np.bool_]


@dataclass
class _MethodSamples:
    """Errors (M, 2), wrong markers and times of a method, over all repetitions."""

    errors: list[NDArray[np.float64]] = field(default_factory=list)
    wrong: int = 0
    ms: list[float] = field(default_factory=list)


def measure_case(case: SceneCase, repetitions: int) -> list[MethodResult]:
    """The results of all methods on one scene. Boards are read with the honeycomb pattern only."""
    scenes = {False: case.scene(), True: case.board()}
    boards = case.pattern == "honeycomb"
    methods = [m for m in METHODS if boards or not m.board or m.name == REFERENCE_METHOD]
    samples = {method.name: _MethodSamples() for method in methods}
    previous: dict[bool, Rendered] = {}
    for seed in range(-1, repetitions):  # the first repetition loads modules
        rendered = {
            board: render(replace(scene, seed=max(seed, 0)), size=STANDARD_SIZE)
            for board, scene in scenes.items()
        }
        current = samples if seed >= 0 else {method.name: _MethodSamples() for method in methods}
        for method in methods:
            if previous:  # reads the previous frame, so that the caches hold this method's data
                method.read(case, np.asarray(previous[method.board].image, np.uint8))
            _update_samples(
                method, case, scenes[method.board].layout, rendered[method.board], current[method.name]
            )
        previous = rendered
    return list(_summarise_methods(case, scenes, methods if boards else methods[:-1], samples))


def _update_samples(
    method: Method, case: SceneCase, layout: Layout, rendered: Rendered, samples: _MethodSamples
) -> None:
    reading = method.read(case, np.asarray(rendered.image, np.uint8))
    errors, wrong = point_errors(reading.points, method.numbered, layout, rendered)
    samples.errors.append(errors)
    samples.wrong += wrong
    samples.ms.append(reading.ms)


def point_errors(
    points: NDArray[np.float64], numbered: bool, layout: Layout, rendered: Rendered
) -> tuple[NDArray[np.float64], int]:
    """(M, 2) errors by marker in px, NaN where not found or wrong, and the number of wrong points."""
    true = rendered.truth.marker_xy_px
    tolerance_px = WRONG_SHARE * shortest_edges(layout, true)
    if not numbered:
        return _match_points(points, true, tolerance_px)
    errors = points - true
    distance_px = np.linalg.norm(errors, axis=1)
    wrong = distance_px > tolerance_px
    errors[wrong] = np.nan
    return errors, int(wrong.sum())


def _match_points(
    points: NDArray[np.float64], true: NDArray[np.float64], tolerance_px: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    """Errors (M, 2) of points without numbers: each marker gets the nearest point; other points count as wrong."""
    errors = np.full_like(true, np.nan)
    if len(points) == 0:
        return errors, 0
    distance_px, marker = cKDTree(true).query(points)
    order = np.argsort(distance_px, kind="stable")
    wrong = 0
    for index in order:
        owner = marker[index]
        if distance_px[index] > tolerance_px[owner] or np.isfinite(errors[owner, 0]):
            wrong += 1
        else:
            errors[owner] = points[index] - true[owner]
    return errors, wrong


def _summarise_methods(
    case: SceneCase, scenes: dict[bool, Scene], methods: list[Method], samples: dict[str, _MethodSamples]
) -> Iterator[MethodResult]:
    required = {board: required_markers(scene) for board, scene in scenes.items()}
    bounds = {board: bound_rms_px(scene, *required[board]) for board, scene in scenes.items()}
    for method in methods:
        sample, (every, inner) = samples[method.name], required[method.board]
        errors = np.array(sample.errors)
        ratios = np.divide(sample.ms, samples[REFERENCE_METHOD].ms)
        yield MethodResult(
            method=method.name, scene=case.name,
            found_share=float(np.isfinite(errors[:, every, 0]).mean()), wrong=sample.wrong,
            all_px=_rms_px(errors[:, every]), inner_px=_rms_px(errors[:, inner]), bias_px=_bias_px(errors[:, inner]),
            all_bound_px=bounds[method.board][0], bound_px=bounds[method.board][1],
            ms=float(np.median(sample.ms)), ratio=float(np.median(ratios)),
        )  # fmt: skip


def required_markers(scene: Scene) -> RequiredMarkers:
    """The markers of a scene that a method should find; of a board only inner corners."""
    from cmpdesign.scene.drawing.render import render_truth

    inner = inner_markers(scene.layout)
    visible = render_truth(scene, size=STANDARD_SIZE).visible
    every = visible if scene.layout.cell_corners.shape[1] == 3 else visible & inner
    return RequiredMarkers(every, visible & inner)


def _rms_px(errors: NDArray[np.float64]) -> float:
    found = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(found**2))) if len(found) else float("nan")


def _bias_px(errors: NDArray[np.float64]) -> float:
    found = errors[np.isfinite(errors[..., 0])]
    return float(abs(found.mean(axis=0)).max()) if len(found) else float("nan")
