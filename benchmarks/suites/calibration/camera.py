"""The pictures of the camera suite, by effect."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from benchmarks.suites.calibration.cases import CalibrationCase, KnownPicture, KnownPositions
from benchmarks.suites.camera.cases import TURN, CameraCase, make_cases, sample_chain
from benchmarks.suites.camera.shoot import image_map, shoot
from benchmarks.suites.scenes import standard_layout

TURNS, QUICK_TURNS = 8, 1  # pictures of every single effect; four have all strengths


def camera_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """The first pictures of the camera suite with this seed."""
    for case in make_cases(len(TURN) * (QUICK_TURNS if quick else TURNS), seed):
        pose = sample_chain(case).pose
        layout = standard_layout(pose.pattern, pose.layers)
        yield CalibrationCase(case.kind, layout, partial(shoot_case, case))


def shoot_case(case: CameraCase) -> KnownPicture:
    """The picture of a case; its true positions are those of the design, mapped by the lens."""
    chain = sample_chain(case)
    picture = shoot(chain)
    virtual_xy_mm = picture.layout.virtual_xy_mm
    virtual_xy_px = image_map(chain, None)(virtual_xy_mm.reshape(-1, 2)).reshape(virtual_xy_mm.shape)
    return KnownPicture(picture.image, (KnownPositions(picture.marker_xy_px, virtual_xy_px),))
