"""Every method on every scene, with interleaved repetitions, so that the machine's load affects all methods equally."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.frame.pooled import rms_of
from benchmarks.suites.comparison.methods import METHODS, REFERENCE_METHOD, Method
from benchmarks.suites.scenes import (
    SCENE_KINDS,
    STANDARD_BLUR_PX,
    STANDARD_PITCH_PX,
    WRONG_SHARE,
    Response,
    SceneCase,
    inner_markers,
    shortest_edges,
)
from benchmarks.suites.scoring.calibration import squared_distances
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Rendered, Scene, render
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.standard import STANDARD_SIZE

Floats = NDArray[np.float64]
WIDE_BLUR_PX, SMALL_PITCH_PX = 1.6, 13.0
CASES = (
    *(SceneCase(kind=kind) for kind in SCENE_KINDS),
    SceneCase(blur_px=WIDE_BLUR_PX),
    SceneCase(pitch_px=SMALL_PITCH_PX),
    SceneCase("round"),
    SceneCase("elliptical"),
)
POOLED_PATTERNS = ("honeycomb", "round", "elliptical")
POOLED_KINDS = (
    ("flat", STANDARD_PITCH_PX),
    ("flat", SMALL_PITCH_PX),
    ("tilt", STANDARD_PITCH_PX),
    ("bulge", STANDARD_PITCH_PX),
    ("twist", STANDARD_PITCH_PX),
)
POOLED_METHODS = (
    "cmpdesign, balanced",
    "cmpdesign, accurate",
    "cornerSubPix on our ids",
    "OpenCV findChessboardCornersSB",
    "OpenCV findChessboardCorners + cornerSubPix",
    "chess-corners, saddle point",
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


@dataclass(frozen=True)
class PooledResult:
    """A method over many scenes. Errors in px, RMS per axis, over found markers; wrong ones are counted only.

    Attributes:
        scenes: number of scenes; ``pictures``: of images, each with its own noise.
        found_share: share of the markers in view; of the board's inner corners.
        wrong: see ``MethodResult``.
        rms_px, bound_px: the errors, and the exact bounds of the same markers.
        inner_px, inner_bound_px: the same over markers with all their gridlines.
        z: sqrt(mean(e' C^-1 e) / 2) over found markers; None if the method states no covariance.
        ms: median processor time.
    """

    method: str
    scenes: int
    pictures: int
    found_share: float
    wrong: int
    rms_px: float
    bound_px: float
    inner_px: float
    inner_bound_px: float
    z: float | None
    ms: float


class Wanted(NamedTuple):
    """The markers of a scene that a method should find; of a board only inner corners.

    Attributes:
        every: (M,) bool; ``inner``: those of them with all their gridlines.
        bound_px2: (M,) the exact bound of both axes together.
    """

    every: NDArray[np.bool_]
    inner: NDArray[np.bool_]
    bound_px2: Floats


class Sample(NamedTuple):
    """One image, read by a method: errors (M, 2) px, NaN where not found or wrong; their squares over the stated
    covariances (M,), None without any; wrong markers; processor time.
    """

    errors_px: Floats
    d2: Floats | None
    wrong: int
    ms: float


class SceneSamples(NamedTuple):
    """The samples of a scene by method, one for each repetition; the board is the scene of True."""

    case: SceneCase
    wanted: dict[bool, Wanted]
    samples: dict[str, list[Sample]]


def wanted_markers(scene: Scene) -> Wanted:
    from cmpdesign.scene.drawing.render import render_truth

    inner = inner_markers(scene.layout)
    visible = render_truth(scene, size=STANDARD_SIZE).visible
    every = visible if scene.layout.cell_corners.shape[1] == 3 else visible & inner
    return Wanted(every, visible & inner, np.einsum("mii->m", exact_bound(scene, size=STANDARD_SIZE)))


def read_scene(case: SceneCase, methods: Sequence[Method], repetitions: int) -> SceneSamples:
    """A scene and its board, each repetition with its own noise, read by all methods in turn."""
    scenes = {board: case.board() if board else case.scene() for board in {m.board for m in methods}}
    samples: dict[str, list[Sample]] = {method.name: [] for method in methods}
    previous: dict[bool, Rendered] = {}
    for seed in range(-1, repetitions):  # the first repetition loads modules
        rendered = {
            board: render(replace(scene, seed=max(seed, 0)), size=STANDARD_SIZE)
            for board, scene in scenes.items()
        }
        for method in methods:
            if previous:  # reads the previous frame, so that the caches hold this method's data
                method.read(case, np.asarray(previous[method.board].image, np.uint8))
            sample = _read_sample(method, case, scenes[method.board].layout, rendered[method.board])
            samples[method.name] += [sample] if seed >= 0 else []
        previous = rendered
    return SceneSamples(case, {board: wanted_markers(scene) for board, scene in scenes.items()}, samples)


def _read_sample(method: Method, case: SceneCase, layout: Layout, rendered: Rendered) -> Sample:
    reading = method.read(case, np.asarray(rendered.image, np.uint8))
    errors, wrong = point_errors(reading.points, method.numbered, layout, rendered)
    d2 = None if reading.cov_px2 is None else squared_distances(errors, reading.cov_px2)
    return Sample(errors, d2, wrong, reading.ms)


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


def measure_case(case: SceneCase, repetitions: int) -> list[MethodResult]:
    """The results of all methods on one scene. Boards are read with the honeycomb pattern only."""
    boards = case.pattern == "honeycomb"
    methods = [m for m in METHODS if boards or not m.board or m.name == REFERENCE_METHOD]
    read = read_scene(case, methods, repetitions)
    return [_method_result(read, method) for method in methods if boards or not method.board]


def _method_result(read: SceneSamples, method: Method) -> MethodResult:
    samples, (every, inner, bound_px2) = read.samples[method.name], read.wanted[method.board]
    errors, ms = np.array([one.errors_px for one in samples]), [one.ms for one in samples]
    ratios = np.divide(ms, [one.ms for one in read.samples[REFERENCE_METHOD]])
    found = errors[:, inner][np.isfinite(errors[:, inner, 0])]
    return MethodResult(
        method=method.name, scene=read.case.name,
        found_share=float(np.isfinite(errors[:, every, 0]).mean()), wrong=sum(one.wrong for one in samples),
        all_px=rms_of(errors[:, every]), inner_px=rms_of(errors[:, inner]),
        bias_px=float(abs(found.mean(axis=0)).max()) if len(found) else float("nan"),
        all_bound_px=rms_per_axis(bound_px2[every]), bound_px=rms_per_axis(bound_px2[inner]),
        ms=float(np.median(ms)), ratio=float(np.median(ratios)),
    )  # fmt: skip


def pooled_cases(response: Response) -> list[SceneCase]:
    """Every pattern in every kind of scene, at both blurs."""
    return [
        SceneCase(pattern, kind, blur_px, pitch_px=pitch_px, response=response)
        for pattern in POOLED_PATTERNS
        for kind, pitch_px in POOLED_KINDS
        for blur_px in (STANDARD_BLUR_PX, WIDE_BLUR_PX)
    ]


def measure_pooled(cases: Sequence[SceneCase], seeds: int) -> list[PooledResult]:
    """Some methods over all cases, with ``seeds`` noises each; boards with the honeycomb cases only."""
    methods = [method for name in POOLED_METHODS for method in METHODS if method.name == name]
    read = [
        read_scene(case, [m for m in methods if case.pattern == "honeycomb" or not m.board], seeds)
        for case in cases
    ]
    return [_pooled_result(method, [one for one in read if method.name in one.samples]) for method in methods]


def _pooled_result(method: Method, read: Sequence[SceneSamples]) -> PooledResult:
    both = [(one, scene.wanted[method.board]) for scene in read for one in scene.samples[method.name]]
    found = [wanted.every & np.isfinite(one.errors_px[:, 0]) for one, wanted in both]

    def joined(values: Iterator[NDArray[np.generic]]) -> NDArray[np.generic]:
        return np.concatenate([value[chosen] for value, chosen in zip(values, found, strict=True)])

    squared_px2 = joined((one.errors_px**2).sum(axis=1) for one, _ in both)
    bound_px2, inner = (
        joined(wanted.bound_px2 for _, wanted in both),
        joined(wanted.inner for _, wanted in both),
    )
    d2 = None if both[0][0].d2 is None else joined(one.d2 for one, _ in both if one.d2 is not None)
    return PooledResult(
        method=method.name, scenes=len(read), pictures=len(both),
        found_share=len(squared_px2) / sum(int(wanted.every.sum()) for _, wanted in both),
        wrong=sum(one.wrong for one, _ in both), rms_px=rms_per_axis(squared_px2), bound_px=rms_per_axis(bound_px2),
        inner_px=rms_per_axis(squared_px2[inner]), inner_bound_px=rms_per_axis(bound_px2[inner]),
        z=None if d2 is None else rms_per_axis(d2), ms=float(np.median([one.ms for one, _ in both])),
    )  # fmt: skip


def rms_per_axis(squares: NDArray[np.generic]) -> float:
    """The root of half the mean of sums of two squares, without unknown ones; NaN without any."""
    return rms_of(np.sqrt(squares / 2))
