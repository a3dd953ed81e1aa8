"""Pictures of coded pads beside the same pictures of plain ones: flat and bent, damaged at random, by cameras.

The suites of ``benchmarks.accuracy``, ``benchmarks.damage`` and ``benchmarks.camera``, with 11 layers or those of the
camera suite.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from benchmarks.frame.parallel import results_of
from benchmarks.frame.pooled import Columns, pooled_table, share, total
from benchmarks.frame.table import Table
from benchmarks.suites.camera.cases import CameraCase, sample_chain
from benchmarks.suites.camera.reading import PictureResult, cached_extractor, rms_px, score_picture
from benchmarks.suites.camera.shoot import CameraPicture, shoot
from benchmarks.suites.scenes import SCENE_KINDS, SceneCase, standard_layout
from benchmarks.suites.scoring.calibration import stated_columns
from benchmarks.suites.stress.frames import PATTERNS, PatternFrame
from benchmarks.suites.stress.random_damage import RANDOM_KINDS
from cmpdesign.scene.standard import STANDARD_LAYERS, STANDARD_SIZE, standard_scene

CODE = 7
COLUMNS: Columns = {
    "pictures": ("d", len),
    "unread": ("d", total("is_unread")),
    "reported": (".1%", share("reported", "visible")),
    "wrong": ("d", lambda results: total("wrong_ids")(results) + total("wrong_places")(results)),
    "RMS px": (".4f", rms_px),
    "z": stated_columns(lambda result: result.d2)["z"],
}


def _frame_picture(frame: PatternFrame) -> CameraPicture:
    shot = frame.shoot()
    return CameraPicture(shot.image, frame.layout, shot.truths[0].marker_xy_px, shot.truths[0].visible)


def scene_picture(number: int, seed: int, code: int) -> CameraPicture:
    """The scenes of ``benchmarks.accuracy``."""
    pattern, kind = PATTERNS[number % len(PATTERNS)], SCENE_KINDS[number // len(PATTERNS) % len(SCENE_KINDS)]
    scene = SceneCase(pattern, kind).scene(standard_layout(pattern, STANDARD_LAYERS, code))
    return _frame_picture(PatternFrame(replace(scene, seed=seed + number)))


def damaged_picture(number: int, seed: int, code: int) -> CameraPicture:
    """The random damage of ``benchmarks.damage``."""
    layout = standard_layout(PATTERNS[number % len(PATTERNS)], STANDARD_LAYERS, code)
    frame = PatternFrame(standard_scene(layout, seed=seed + number), STANDARD_SIZE)
    changed = RANDOM_KINDS[number % len(RANDOM_KINDS)].change(frame, 0)
    assert isinstance(changed, PatternFrame)
    return _frame_picture(changed)


def camera_picture(number: int, seed: int, code: int) -> CameraPicture:
    """The cameras, lamps and inks of ``benchmarks.camera``."""
    chain = sample_chain(CameraCase(seed, number))
    return shoot(replace(chain, pose=replace(chain.pose, code=code)))


SUITES: dict[str, Callable[[int, int, int], CameraPicture]] = {
    "flat and bent": scene_picture,
    "random damage": damaged_picture,
    "cameras": camera_picture,
}


def read_picture(number: int, suite: str, seed: int, code: int) -> PictureResult:
    """Draw and read one picture."""
    picture = SUITES[suite](number, seed, code)
    layout = picture.layout
    reader = cached_extractor(layout.pattern, int(layout.marker_layer.max()), "balanced", code)
    return score_picture(CameraCase(seed, number), picture, reader.extract(picture.image))


def beside_table(pictures: int, seed: int, processes: int) -> Table:
    """A row for the coded pads of each suite, and one for the plain ones."""
    groups: dict[str, Sequence[PictureResult]] = {}
    for suite in SUITES:
        for name, code in (("coded", CODE), ("plain", 0)):
            read = partial(read_picture, suite=suite, seed=seed, code=code)
            groups[f"{suite}, {name}"] = results_of(read, range(pictures), processes)
    return pooled_table("coded pads and plain ones", "pads", COLUMNS, groups)
