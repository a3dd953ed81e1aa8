"""One picture of a suite of calibration, and random standard views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.suites.scenes import SceneCase, standard_layout
from benchmarks.suites.stress.frames import CaseImage, PatternFrame
from cmpdesign.layout.layout import Layout


@dataclass(frozen=True, eq=False)
class KnownPositions:
    """The true positions of one pattern.

    Attributes:
        marker_xy_px: (M, 2).
        virtual_xy_px: (E, m, 2), in the order of the layout's edges; without rows where not known.
        visible: (M,) bool; None where not known.
    """

    marker_xy_px: NDArray[np.float64]
    virtual_xy_px: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0, 2)))
    visible: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class KnownPicture:
    """A picture with the positions of its one pattern."""

    image: NDArray[np.uint8]
    truths: tuple[KnownPositions, ...]


@dataclass(frozen=True, eq=False)
class CalibrationCase:
    """One picture.

    Attributes:
        kind: the name of its row within the suite.
        layout: the layout that the reader is given; the picture may show a different one.
        shoot: makes the picture.
    """

    kind: str
    layout: Layout
    shoot: Callable[[], KnownPicture | CaseImage]


def random_view(case: SceneCase, rng: np.random.Generator) -> PatternFrame:
    """The case's scene at a random rotation, with a random seed of its noise; ``rng`` is advanced."""
    turn_deg, seed = float(rng.uniform(0, 360)), int(rng.integers(2**31))
    return PatternFrame(case.scene()).with_camera(rotation_deg=turn_deg).with_parts(seed=seed)


def frame_case(kind: str, case: SceneCase, frame: PatternFrame) -> CalibrationCase:
    """A frame that is read with the nominal layout of the case's pattern."""
    return CalibrationCase(kind, standard_layout(case.pattern, case.layers), frame.shoot)
