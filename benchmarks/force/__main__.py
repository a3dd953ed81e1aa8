"""``python -m benchmarks.force``: force, torque and regions of the finite-element frames, as the reader finds them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.force.seen import seen_from
from benchmarks.force.truth import FRICTION, TRUTH, YOUNG_MPA, Case, cases
from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from cmpdesign import build_layout
from cmpdesign.contact import Elastomer
from cmpdesign.contact.finite_block import make_gel
from cmpdesign.design.design import load_design
from extractor import ContactForce, ContactReader

Array = NDArray[np.float64]
DEPTH_PLACE, DEPTH_MM = 0, 0.5  # of ``DEPTHS_MM``
LEAST_N = 0.3  # of the summary's frames
COLUMNS = {
    "contact": TEXT, "Fz, N": ".3f", "error": "+.1%", "z": "+.1f", "shear": ".1%", "torque": ".1%", "torque z": ".1f",
    "centre, um": ".0f", "radius": "+.0%", "utilisation": "+.3f", "regions": "d", "cold ms": ".1f", "warm ms": ".1f",
}  # fmt: skip
FLAT = ("twist", "punch", "ring")  # their touched area is not that of a ball


class Errors(NamedTuple):
    """One frame: errors as shares of the press, z in stated deviations, lengths in mm.

    The share of the torque is that of the largest torque of the press on its contact's radius and of the truth.
    """

    name: str
    press_n: float
    normal: float
    normal_z: float
    shear: float
    shear_z: Array
    torque: float
    torque_z: Array
    centre_mm: float
    radius: float
    utilisation: float
    regions: int
    cold_ms: float
    warm_ms: float


def errors_of(found: ContactForce, frame: dict[str, Array], name: str, times_ms: list[float]) -> Errors:
    """The errors of one frame of the truth."""
    press, error = -float(frame["force_n"][2]), found.force_n - frame["force_n"]
    sigma, torque_sigma = (np.sqrt(np.diag(cov)) for cov in (found.force_cov_n2, found.torque_cov_nmm2))
    torque = found.torque_nmm - frame["torque_nmm"]
    radius_mm = float(np.sqrt(frame["area_mm2"][0] / np.pi))
    size = max(float(np.linalg.norm(frame["torque_nmm"])), press * radius_mm)
    centres = [region.centre_mm for region in found.regions] or [np.full(2, np.nan)]
    off = np.hypot(*(centres[0] - frame["centre_mm"]).T)
    areas = [region.area_mm2 for region in found.regions] or [np.nan]
    return Errors(
        name,
        press,
        -float(error[2]) / press,
        float(error[2] / sigma[2]),
        float(np.hypot(*error[:2])) / press,
        error[:2] / sigma[:2],
        float(np.linalg.norm(torque)) / size,
        torque / torque_sigma,
        float(off.min()),
        np.nan if name in FLAT else float(np.sqrt(areas[0] / np.pi)) / radius_mm - 1,
        found.utilisation - float(frame["utilisation"]),
        len(found.regions),
        *times_ms,
    )


@cache
def _reader(thickness_mm: float, poisson: float) -> ContactReader:
    layout, layer = build_layout(load_design("honeycomb")), Elastomer(thickness_mm, 1.0, poisson, DEPTH_MM)
    return ContactReader(layout, make_gel(layout, layer), YOUNG_MPA, friction=FRICTION)


def read_case(
    case: Case, frames: list[dict[str, Array]], random: np.random.Generator, far_mm: float | None
) -> Iterator[Errors]:
    """The frames of a contact, read from two views' displacements, or from one view far away."""
    seen = seen_from(_reader(case.thickness_mm, case.poisson), far_mm)
    for frame in frames:
        moved, times_ms = frame["displacement_mm"][DEPTH_PLACE].astype(np.float64), []
        seen.reader.reset()
        for _ in range(2):
            start = time.process_time()
            found = seen.read(moved, random)
            times_ms.append(1e3 * (time.process_time() - start))
        yield errors_of(found, frame, case.name, times_ms)


def summary_lines(found: list[Errors]) -> Iterator[str]:
    """Root mean square and worst of every error, and z."""
    yield f"{len(found)} frames above {LEAST_N} N"
    for name in ("normal", "shear", "torque", "centre_mm", "radius", "utilisation"):
        values = np.array([getattr(one, name) for one in found])
        values = values[np.isfinite(values)]
        text = f"rms {np.sqrt((values**2).mean()):.3f}, worst {np.abs(values).max():.3f}"
        if hasattr(found[0], f"{name}_z"):
            z = np.concatenate([np.atleast_1d(getattr(one, f"{name}_z")) for one in found])
            text += f", z {np.sqrt((z**2).mean()):.2f}"
        yield f"{name}: {text}"


def measure(one_view: float | None = None, only: tuple[str, ...] = (), seed: int = 1) -> Shown:
    """One row for every frame, markers 0.5 mm deep, and the summary of the frames above 0.3 N.

    Args:
        one_view: distance of a single camera, mm; two views without it.
        only: names of contacts; all by default.
    """
    with np.load(TRUTH) as file:
        truth = dict(file)
    random = np.random.default_rng(seed)
    found: list[Errors] = []
    for case in cases():
        mine = np.flatnonzero(truth["case"] == case.name)
        if len(mine) and (not only or case.name in only):
            frames = [{key: values[k] for key, values in truth.items()} for k in mine]
            found += read_case(case, frames, random, one_view)
    rows = [
        (
            one.name, one.press_n, one.normal, one.normal_z, one.shear, one.torque,
            np.sqrt((one.torque_z**2).mean()), 1e3 * one.centre_mm, one.radius, one.utilisation, one.regions,
            one.cold_ms, one.warm_ms,
        )
        for one in found
    ]  # fmt: skip
    yield Table("frames", COLUMNS, rows)
    yield from summary_lines([one for one in found if one.press_n > LEAST_N])


main = Experiment("force", measure)

if __name__ == "__main__":
    raise SystemExit(main())
