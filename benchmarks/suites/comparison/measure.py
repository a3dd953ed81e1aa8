"""Every method on every scene: repetitions interleaved, so that whatever else the machine does meets them all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.suites.comparison.methods import METHODS, REFERENCE_METHOD, Method
from benchmarks.support.scenes import (
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

CASES = (*(SceneCase(kind=kind) for kind in SCENE_KINDS), SceneCase("round"), SceneCase("elliptical"))


@dataclass(frozen=True)
class MethodResult:
    """A method in a scene. Errors in px, RMS per axis, over found markers; wrong ones are counted, not averaged.

    Attributes:
        found_share: of the markers in view; for the board, of its inner corners.
        wrong: markers found farther than 0.3 of an edge from their own place, or points where there is none, in all
            repetitions.
        bias_px: the mean error, the larger of both axes.
        inner_px, bound_px: over markers with all their gridlines; the bound is that of the pattern that was read.
        ms: processor time, the median; ``ratio``: over the reference's time in the same repetition, the median.
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


@dataclass
class _MethodSamples:
    errors: list[NDArray[np.float64]] = field(default_factory=list)
    wrong: int = 0
    ms: list[float] = field(default_factory=list)


def measure_case(case: SceneCase, repetitions: int) -> list[MethodResult]:
    """All methods on one scene; boards are not read twice for patterns that only differ from it in theirs."""
    scenes = {False: case.scene(), True: case.board()}
    boards = case.pattern == "honeycomb"
    methods = [m for m in METHODS if boards or not m.board or m.name == REFERENCE_METHOD]
    tallies = {method.name: _MethodSamples() for method in methods}
    before: dict[bool, Rendered] = {}
    for seed in range(-1, repetitions):  # the first is not counted: it loads and compiles
        seen = {
            board: render(replace(scene, seed=max(seed, 0)), size=STANDARD_SIZE)
            for board, scene in scenes.items()
        }
        tally = tallies if seed >= 0 else {method.name: _MethodSamples() for method in methods}
        for method in methods:
            if before:  # the frame before, as a camera gives them: no method is timed with another's data in the caches
                method.read(case, np.asarray(before[method.board].image, np.uint8))
            _update_samples(method, case, scenes[method.board].layout, seen[method.board], tally[method.name])
        before = seen
    return list(_summarise_methods(case, scenes, methods if boards else methods[:-1], tallies))


def _update_samples(
    method: Method, case: SceneCase, layout: Layout, seen: Rendered, tally: _MethodSamples
) -> None:
    reading = method.read(case, np.asarray(seen.image, np.uint8))
    errors, wrong = point_errors(reading.points, method.numbered, layout, seen)
    tally.errors.append(errors)
    tally.wrong += wrong
    tally.ms.append(reading.ms)


def point_errors(
    points: NDArray[np.float64], numbered: bool, layout: Layout, seen: Rendered
) -> tuple[NDArray[np.float64], int]:
    """(M, 2) errors by marker, NaN where it was not found or is wrong, and how many points are wrong."""
    true = seen.truth.marker_xy_px
    near = WRONG_SHARE * shortest_edges(layout, true)
    if not numbered:
        return _match_points(points, true, near)
    errors = points - true
    away = np.linalg.norm(errors, axis=1)
    wrong = away > near
    errors[wrong] = np.nan
    return errors, int(wrong.sum())


def _match_points(
    points: NDArray[np.float64], true: NDArray[np.float64], near: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    """Each point belongs to the nearest marker, each marker takes one point; the other points are invented."""
    errors = np.full_like(true, np.nan)
    if len(points) == 0:
        return errors, 0
    away, marker = cKDTree(true).query(points)
    order = np.argsort(away, kind="stable")
    wrong = 0
    for index in order:
        owner = marker[index]
        if away[index] > near[owner] or np.isfinite(errors[owner, 0]):
            wrong += 1
        else:
            errors[owner] = points[index] - true[owner]
    return errors, wrong


def _summarise_methods(
    case: SceneCase, scenes: dict[bool, Scene], methods: list[Method], tallies: dict[str, _MethodSamples]
) -> Iterator[MethodResult]:
    owed = {board: _required_markers(scene) for board, scene in scenes.items()}
    bounds = {board: bound_rms_px(scene, *owed[board]) for board, scene in scenes.items()}
    for method in methods:
        tally, (every, inner) = tallies[method.name], owed[method.board]
        errors = np.array(tally.errors)
        ratios = np.divide(tally.ms, tallies[REFERENCE_METHOD].ms)
        yield MethodResult(
            method=method.name, scene=case.name,
            found_share=float(np.isfinite(errors[:, every, 0]).mean()), wrong=tally.wrong,
            all_px=_rms_px(errors[:, every]), inner_px=_rms_px(errors[:, inner]), bias_px=_bias_px(errors[:, inner]),
            all_bound_px=bounds[method.board][0], bound_px=bounds[method.board][1],
            ms=float(np.median(tally.ms)), ratio=float(np.median(ratios)),
        )  # fmt: skip


def _required_markers(scene: Scene) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The markers that a method should find, and those with all their gridlines; of a board these are the same."""
    from cmpdesign.scene.drawing.render import render_truth

    inner = inner_markers(scene.layout)
    visible = render_truth(scene, size=STANDARD_SIZE).visible
    every = visible if scene.layout.cell_corners.shape[1] == 3 else visible & inner
    return every, visible & inner


def _rms_px(errors: NDArray[np.float64]) -> float:
    found = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(found**2))) if len(found) else float("nan")


def _bias_px(errors: NDArray[np.float64]) -> float:
    found = errors[np.isfinite(errors[..., 0])]
    return float(abs(found.mean(axis=0)).max()) if len(found) else float("nan")
