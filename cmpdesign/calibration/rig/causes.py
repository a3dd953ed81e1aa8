"""Why the residuals of a calibrated sensor at rest may have grown, and the step to repeat for each cause."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.rig.unknowns import POSE_NAMES, Unknowns

Array = NDArray[np.float64]

RIG, CAMERA, GEL_FILE = (f"cmpdesign calibrate {name}" for name in ("rig", "camera", "gel"))
PAD = "the pad has moved against the camera"
VIEWS = "a camera or a mirror has moved"
FOCUS = "the lens has another focal length or focus"
GEL = "another gel, or another pad"
SIZE = "the pattern or the gel has another size, as by temperature"
LOCAL = "the pattern is touched or dirty, or several causes at once"
STEPS = {
    PAD: f"calibrate the rig again: {RIG}",
    VIEWS: f"fasten camera and mirrors, then calibrate the rig again: {RIG}",
    FOCUS: f"fix the focus, then calibrate camera and rig again: {CAMERA}, {RIG}",
    GEL: f"correct [medium], then calibrate the rig again: {RIG}; for forces also {GEL_FILE}",
    SIZE: "wait until the sensor is as warm as at its calibration, and check again; if it stays, correct [medium], "
    f"then calibrate the rig again: {RIG}",
    LOCAL: "clean the pad, take pictures without contact, and check again; if it stays, check the layout, then "
    f"calibrate camera and rig again: {CAMERA}, {RIG}",
}
PARTS = {
    GEL: (PAD, SIZE),
    VIEWS: (PAD, SIZE, FOCUS, GEL),
}  # causes that are a part of another one, or nearly so


class Column(NamedTuple):
    """A parameter of a cause: its name, and its effect (P + 1,) on the unknowns and the pattern's size."""

    name: str
    effect: Array


def columns_by_cause(unknowns: Unknowns) -> dict[str, list[Column]]:
    """Every cause's parameters, for views with poses."""
    views, count = unknowns.views, unknowns.count
    unit = np.eye(count + 1)
    pad = [_pad_column(unknowns, k) for k in range(6)]
    size = Column("pattern_size_share", unit[count])
    gel = [Column(name, unit[unknowns.medium_slice.start + i]) for i, name in enumerate(unknowns.medium)]
    focus = []
    for numbers, place in zip(unknowns.cameras, unknowns.camera_slices, strict=True):
        fx, fy = views[numbers[0]].focal_px
        name = "+".join(views[n].name for n in numbers)
        focus.append(Column(f"{name}.focal_share", fx * unit[place.start] + fy * unit[place.start + 1]))
    out = {PAD: pad, FOCUS: focus, GEL: [*pad, *gel, size], SIZE: [size, *gel[:1]]}
    if len(views) > 1:
        out[VIEWS] = [
            Column(f"{view.name}.{name}", unit[unknowns.pose_slice(v).start + k])
            for v, view in enumerate(views)
            for k, name in enumerate(POSE_NAMES)
        ]
    return out


def _pad_column(unknowns: Unknowns, number: int) -> Column:
    """A turn or a shift of the pad along an axis of the layout, in all views."""
    out = np.zeros(unknowns.count + 1)
    for v, view in enumerate(unknowns.views):
        turn = view.R_camera_from_layout
        side = np.linalg.det(turn) if number < 3 else 1.0  # a mirror turns rotations over
        first = unknowns.pose_slice(v).start + (0 if number < 3 else 3)
        out[first : first + 3] = side * turn[:, number % 3]
    return Column(f"pad.{POSE_NAMES[number]}", out)
