"""Errors over bounds, stated errors and times, pooled over many scenes: one figure per method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.comparison.measure import (
    SMALL_PITCH_PX,
    WIDE_BLUR_PX,
    point_errors,
    required_markers,
)
from benchmarks.suites.comparison.methods import METHODS, Method
from benchmarks.suites.scenes import STANDARD_BLUR_PX, STANDARD_PITCH_PX, Response, SceneCase
from benchmarks.suites.scoring.calibration import squared_distances
from cmpdesign.scene import render
from cmpdesign.scene.bounds.exact_bound import exact_bound
from cmpdesign.scene.standard import STANDARD_SIZE

PATTERNS = ("honeycomb", "round", "elliptical")
KINDS = (
    ("flat", STANDARD_PITCH_PX),
    ("flat", SMALL_PITCH_PX),
    ("tilt", STANDARD_PITCH_PX),
    ("bulge", STANDARD_PITCH_PX),
    ("twist", STANDARD_PITCH_PX),
)
NAMES = (
    "cmpdesign, balanced",
    "cmpdesign, accurate",
    "cornerSubPix on our ids",
    "OpenCV findChessboardCornersSB",
    "OpenCV findChessboardCorners + cornerSubPix",
    "chess-corners, saddle point",
)


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


@dataclass
class _PooledSums:
    """Sums over the pictures that a method has read."""

    scenes: int = 0
    required: int = 0
    wrong: int = 0
    squared_px2: list[NDArray[np.float64]] = field(default_factory=list)
    bound_px2: list[NDArray[np.float64]] = field(default_factory=list)
    inner: list[NDArray[np.bool_]] = field(default_factory=list)
    normalised: list[NDArray[np.float64]] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)


def pooled_cases(response: Response) -> list[SceneCase]:
    """Every pattern in every kind of scene, at both blurs."""
    return [
        SceneCase(pattern, kind, blur_px, pitch_px=pitch_px, response=response)
        for pattern in PATTERNS
        for kind, pitch_px in KINDS
        for blur_px in (STANDARD_BLUR_PX, WIDE_BLUR_PX)
    ]


def measure_pooled(cases: Sequence[SceneCase], seeds: int) -> list[PooledResult]:
    """The methods of ``NAMES`` over all cases, with ``seeds`` noises each; boards with the honeycomb cases only."""
    methods = [method for name in NAMES for method in METHODS if method.name == name]
    sums = {method.name: _PooledSums() for method in methods}
    for case in cases:
        for board in (False, True) if case.pattern == PATTERNS[0] else (False,):
            chosen = [method for method in methods if method.board == board]
            _update_sums(case, board, chosen, seeds, sums)
    return [_pooled_result(name, part) for name, part in sums.items() if part.scenes]


def _update_sums(
    case: SceneCase, board: bool, methods: Sequence[Method], seeds: int, sums: dict[str, _PooledSums]
) -> None:
    """Add one scene, of the pattern or of the board, to the methods' sums."""
    scene = case.board() if board else case.scene()
    every, inner = required_markers(scene)
    bound_px2 = np.einsum("mii->m", exact_bound(scene, size=STANDARD_SIZE))
    for method in methods:
        sums[method.name].scenes += 1
    for seed in range(-1, seeds):  # the first reading loads modules
        rendered = render(replace(scene, seed=max(seed, 0)), size=STANDARD_SIZE)
        for method in methods:
            reading = method.read(case, np.asarray(rendered.image, np.uint8))
            if seed < 0:
                continue
            part = sums[method.name]
            errors, wrong = point_errors(reading.points, method.numbered, scene.layout, rendered)
            found = every & np.isfinite(errors[:, 0])
            part.required += int(every.sum())
            part.wrong += wrong
            part.squared_px2.append((errors[found] ** 2).sum(axis=1))
            part.bound_px2.append(bound_px2[found])
            part.inner.append(inner[found])
            if reading.cov_px2 is not None:
                part.normalised.append(squared_distances(errors[found], reading.cov_px2[found]))
            part.ms.append(reading.ms)


def _pooled_result(name: str, part: _PooledSums) -> PooledResult:
    squared, bound = np.concatenate(part.squared_px2), np.concatenate(part.bound_px2)
    inner, normalised = np.concatenate(part.inner), np.concatenate([np.empty(0), *part.normalised])
    return PooledResult(
        method=name, scenes=part.scenes, pictures=len(part.ms), found_share=len(squared) / part.required,
        wrong=part.wrong, rms_px=_rms_per_axis(squared), bound_px=_rms_per_axis(bound),
        inner_px=_rms_per_axis(squared[inner]), inner_bound_px=_rms_per_axis(bound[inner]),
        z=_rms_per_axis(normalised) if len(normalised) else None, ms=float(np.median(part.ms)),
    )  # fmt: skip


def _rms_per_axis(squares: NDArray[np.float64]) -> float:
    """The root of half the mean of sums of two squares; NaN without any."""
    return float(np.sqrt(squares.mean() / 2)) if len(squares) else float("nan")
