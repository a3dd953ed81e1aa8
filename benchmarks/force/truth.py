"""The finite-element frames that the force benchmark reads, as one file.

With ``pypardiso`` from PyPI, which is no dependency of the project, a frame takes some ten seconds of one core.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.force.neo_hookean_block import NeoHookeanBlock, Pose
from benchmarks.force.objects import RigidObject
from benchmarks.frame.experiment import Experiment, Shown
from cmpdesign import build_layout
from cmpdesign.design.design import load_design

Array = NDArray[np.float64]
TRUTH = Path(__file__).parent / "truth.npz"
DEPTHS_MM = (0.0, 0.5, 1.0)
YOUNG_MPA, FRICTION = 0.3, 0.5
TOUCHED = 0.02  # of the largest pressure, above which a place counts as touched


class Case(NamedTuple):
    """One contact: an object, its poses in order, and the block where it is not the usual one.

    Attributes:
        fitted: the reader's stated deviations were chosen by its frames; the other contacts test them.
    """

    name: str
    target: RigidObject
    poses: tuple[Pose, ...]
    thickness_mm: float = 4.0
    poisson: float = 0.5
    fine_mm: float = 1.1
    fine_radius_mm: float = 3.0
    fitted: bool = False


def _presses(*depths: float, x: float = 0.0, y: float = 0.0) -> tuple[Pose, ...]:
    return tuple(Pose(x, y, -depth) for depth in depths)


def _ball(radius: float, x: float = 0.0, y: float = 0.0) -> RigidObject:
    return RigidObject("points", radius, ((x, y),))


def cases() -> tuple[Case, ...]:
    """The contacts of the truth, in the order of the file."""
    # seven of the usual ball, two balls 3 mm apart, and edges: each half has presses, shear and torsion
    drag = tuple(Pose(x, 0.0, -0.7) for x in (0.15, 0.3, 0.45, 0.6, 0.8))
    slanted = tuple(Pose(0.5 * way, way, -0.6) for way in (0.0, 0.15, 0.3, 0.6))
    twist = (Pose(0, 0, -0.2), Pose(0, 0, -0.4), *(Pose(0, 0, -0.4, turn) for turn in (4.0, 8.0, 12.0)))
    spun = (*(Pose(0, 0, -0.5, turn) for turn in (0.0, 6.0, 12.0)), Pose(0.25, 0, -0.5, 12.0))
    two = (*_presses(0.2, 0.5), Pose(0.2, 0.1, -0.5))
    disk, punch = RigidObject("disk", 0.6, ((-1.0, 1.5),), 2.4), RigidObject("disk", 0.5, ((0.5, 0.3),), 2.0)
    ring = RigidObject("circle", 0.75, ((0.0, 0.0),), 3.0)
    pair = RigidObject("points", 1.5, ((-1.5, 0.4), (1.5, 0.4)))
    thin = (*_presses(0.25, 0.5), Pose(0.3, 0, -0.5))
    return (
        Case("shear", _ball(5), (*_presses(0.35, 0.7), *drag), fitted=True),
        Case("twist", disk, twist, fitted=True),
        Case("drag", _ball(4, 2.1, -3.2), slanted),
        Case("spun ball", _ball(6, -3.0, -1.6), spun),
        Case("two balls", pair, two, fine_mm=0.75, fine_radius_mm=1.2, fitted=True),
        Case("punch", punch, (*_presses(0.15, 0.3, 0.5), Pose(0.2, 0, -0.5)), fine_radius_mm=2.5),
        Case(
            "oblique",
            _ball(4, 3, -2),
            tuple(Pose(0.6 * s, 0.3 * s, -s) for s in (0.3, 0.6, 0.9)),
            fitted=True,
        ),
        Case("thin layer", _ball(5, 1, 1), thin, thickness_mm=2.0, fitted=True),
        Case("nu .49", _ball(5), (*_presses(0.4, 0.8), Pose(0.3, 0, -0.8)), poisson=0.49),
        Case("rim", _ball(4, 11.0, 0.5), (*_presses(0.3, 0.6), Pose(0.3, 0, -0.6))),
        Case("small ball", _ball(3, -2.3, 1.1), _presses(0.3, 0.6, 0.9), fitted=True),
        Case("ball", _ball(5), _presses(0.25, 0.5, 0.8, 1.1)),
        Case("ring", ring, _presses(0.2, 0.4, 0.6), fine_mm=0.9, fine_radius_mm=4.0),
    )


def solve_case(case: Case, outline_mm: Array, markers_mm: Array) -> Iterator[dict[str, Array]]:
    """Every frame of a contact as the fields of the file."""
    block = NeoHookeanBlock(
        outline_mm,
        case.thickness_mm,
        YOUNG_MPA,
        case.poisson,
        case.target,
        FRICTION,
        case.fine_mm,
        case.fine_radius_mm,
    )
    for pose in case.poses:
        wrench = block.move(pose)
        at, traction, area = block.pressure_map()
        pressure = block.last.pressure
        touched = pressure > TOUCHED * pressure.max()
        sides = [
            touched & side
            for side in ((at[:, 0] < 0, at[:, 0] >= 0) if len(case.target.centres_mm) == 2 else (touched,))
        ]
        yield {
            "displacement_mm": np.stack([block.displacement(markers_mm, d) for d in DEPTHS_MM]).astype(
                np.float32
            ),
            "force_n": wrench.force_n,
            "torque_nmm": wrench.torque_nmm,
            "rest_torque_nmm": np.cross(at, traction * area[:, None]).sum(axis=0),
            "pose": np.array(pose),
            "area_mm2": np.array([area[s].sum() for s in sides + sides[:1]][:2]),
            "centre_mm": np.stack(
                [
                    (at[s, :2] * (pressure * area)[s, None]).sum(0) / (pressure * area)[s].sum()
                    for s in sides + sides[:1]
                ][:2]
            ),
            "utilisation": np.array(np.hypot(*wrench.force_n[:2]) / (FRICTION * -wrench.force_n[2])),
            "largest_pressure_mpa": np.array(pressure.max()),
        }


def measure(only: tuple[str, ...] = (), out: Path = TRUTH) -> Shown:
    """Solve the contacts and write the file.

    Args:
        only: names of contacts; all by default.
        out: the file.
    """
    layout = build_layout(load_design("honeycomb"))
    rows, names = [], []
    for case in cases():
        if only and case.name not in only:
            continue
        for frame in solve_case(case, layout.outline_mm, layout.marker_xy_mm):
            yield f"{case.name} {frame['pose'].round(2)} {frame['force_n'].round(3)} {frame['torque_nmm'].round(2)}"
            rows.append(frame)
            names.append(case.name)
            columns = {key: np.stack([row[key] for row in rows]) for key in frame}
            np.savez_compressed(out, case=np.array(names), **columns)


main = Experiment("force.truth", measure)
main.run_as(__name__)
