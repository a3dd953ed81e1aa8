"""Pictures of coded pads beside the same pictures of plain ones: flat and bent, damaged at random, by cameras.

The suites of ``benchmarks.accuracy``, ``benchmarks.damage`` and ``benchmarks.camera``, with 11 layers or those of the
camera suite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.parallel import results_of
from benchmarks.suites.camera.cases import make_cases, sample_chain
from benchmarks.suites.camera.shoot import shoot
from benchmarks.suites.scenes import SCENE_KINDS, WRONG_SHARE, SceneCase, shortest_edges, standard_layout
from benchmarks.suites.scoring.calibration import squared_distances, summarise
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import render
from cmpdesign.scene.standard import STANDARD_LAYERS, STANDARD_SIZE, standard_scene
from extractor import Extractor, Status, parse_layout

CODE = 7


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture (H, W, 3) uint8 BGR, the pad's layout, the markers' true positions (M, 2), and which are visible."""

    image: NDArray[np.uint8]
    layout: Layout
    marker_xy_px: NDArray[np.float64]
    visible: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PictureCounts:
    """What was read of a picture: numbers of markers; (N, 2) errors and (N,) errors over covariances of measured
    markers."""

    visible: int
    reported: int
    wrong: int
    error_px: NDArray[np.float64]
    d2: NDArray[np.float64]


@dataclass(frozen=True)
class Figures:
    """Of one suite: pictures that gave no marker, the share of visible markers with a position, wrong ones, the RMS per
    axis of measured markers, px, and z."""

    unread: int
    reported: float
    wrong: int
    rms_px: float
    z: float


def scene_picture(number: int, seed: int, code: int) -> Picture:
    """The scenes of ``benchmarks.accuracy``."""
    pattern, kind = PATTERNS[number % len(PATTERNS)], SCENE_KINDS[number // len(PATTERNS) % len(SCENE_KINDS)]
    layout = standard_layout(pattern, STANDARD_LAYERS, code)
    shot = render(replace(SceneCase(pattern, kind).scene(layout), seed=seed + number), size=STANDARD_SIZE)
    return Picture(shot.image, layout, shot.truth.marker_xy_px, shot.truth.visible)


def damaged_picture(number: int, seed: int, code: int) -> Picture:
    """The random damage of ``benchmarks.damage``."""
    layout = standard_layout(PATTERNS[number % len(PATTERNS)], STANDARD_LAYERS, code)
    frame = PatternFrame(standard_scene(layout, seed=seed + number), STANDARD_SIZE)
    changed = RANDOM_KINDS[number % len(RANDOM_KINDS)].change(frame, 0)
    shot = changed.shoot()
    return Picture(shot.image, layout, shot.truths[0].marker_xy_px, shot.truths[0].visible)


def camera_picture(number: int, seed: int, code: int) -> Picture:
    """The cameras, lamps and inks of ``benchmarks.camera``."""
    chain = sample_chain(make_cases(number + 1, seed)[number])
    shot = shoot(replace(chain, pose=replace(chain.pose, code=code)))
    return Picture(shot.image, shot.layout, shot.marker_xy_px, shot.visible)


SUITES: dict[str, Callable[[int, int, int], Picture]] = {
    "flat and bent": scene_picture,
    "random damage": damaged_picture,
    "cameras": camera_picture,
}


@cache
def _reader(pattern: str, layers: int, code: int) -> Extractor:
    return Extractor(parse_layout(layout_to_json(standard_layout(pattern, layers, code))))


def read_picture(number: int, suite: str, seed: int, code: int) -> PictureCounts:
    """Draw and read one picture."""
    picture = SUITES[suite](number, seed, code)
    layout, true_px = picture.layout, picture.marker_xy_px
    markers = _reader(layout.pattern, int(layout.marker_layer.max()), code).extract(picture.image)
    error_px = markers.xy_px - true_px
    reported = np.isfinite(markers.xy_px).all(axis=1)
    wrong = reported & ~(np.linalg.norm(error_px, axis=1) <= WRONG_SHARE * shortest_edges(layout, true_px))
    measured = (markers.status == Status.MEASURED) & picture.visible & ~wrong
    return PictureCounts(
        visible=int(picture.visible.sum()),
        reported=int((reported & picture.visible).sum()),
        wrong=int(wrong.sum()),
        error_px=error_px[measured],
        d2=squared_distances(error_px[measured], markers.cov_px2[measured]),
    )


def figures_of(suite: str, code: int, pictures: int, seed: int, processes: int) -> Figures:
    """The figures of one suite, of pads with a code, or plain ones (0)."""
    read = results_of(partial(read_picture, suite=suite, seed=seed, code=code), range(pictures), processes)
    errors = np.concatenate([one.error_px for one in read])
    return Figures(
        unread=sum(one.reported == 0 for one in read),
        reported=sum(one.reported for one in read) / max(sum(one.visible for one in read), 1),
        wrong=sum(one.wrong for one in read),
        rms_px=float(np.sqrt(np.mean(errors**2))),
        z=summarise([one.d2 for one in read]).z.value,
    )
