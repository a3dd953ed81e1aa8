"""The pictures of the camera suite, by effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.calibration.cases import CalibrationCase
from benchmarks.suites.camera.cases import TURN, CameraCase, make_cases, sample_chain
from benchmarks.suites.camera.shoot import cached_layout, image_map, shoot

TURNS, QUICK_TURNS = 8, 1  # pictures of every single effect; four have all strengths


@dataclass(frozen=True, eq=False)
class DesignedPositions:
    """The true positions in a picture: the positions of the design, mapped by the lens.

    Attributes:
        marker_xy_px: (M, 2).
        virtual_xy_px: (E, m, 2), in the order of the layout's edges.
    """

    marker_xy_px: NDArray[np.float64]
    virtual_xy_px: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CasePicture:
    """A picture with the positions of its one pattern."""

    image: NDArray[np.uint8]
    truths: Sequence[DesignedPositions]


def camera_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """The first pictures of the camera suite with this seed."""
    for case in make_cases(len(TURN) * (QUICK_TURNS if quick else TURNS), seed):
        pose = sample_chain(case).pose
        layout = cached_layout(pose.pattern, pose.layers)
        yield CalibrationCase(case.kind, layout, partial(shoot_case, case))


def shoot_case(case: CameraCase) -> CasePicture:
    """The picture of a case with its truth."""
    chain = sample_chain(case)
    picture = shoot(chain)
    virtual_xy_mm = picture.layout.virtual_xy_mm
    virtual_xy_px = image_map(chain, None)(virtual_xy_mm.reshape(-1, 2)).reshape(virtual_xy_mm.shape)
    return CasePicture(picture.image, (DesignedPositions(picture.marker_xy_px, virtual_xy_px),))
