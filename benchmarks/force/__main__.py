"""``python -m benchmarks.force``: force, torque and regions of the finite-element frames, as the reader finds them.

The contacts have two halves: by the errors of the one the reader's deviations (``ForceModel``) were chosen, the other
one tests them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.force.seen import seen_from
from benchmarks.force.truth import DEPTHS_MM, FRICTION, TRUTH, YOUNG_MPA, Case, cases
from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.pooled import rms_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
from cmpdesign import build_layout
from cmpdesign.contact import Elastomer
from cmpdesign.contact.finite_block import make_gel
from cmpdesign.design.design import load_design
from extractor import ContactForce, ContactReader

Array = NDArray[np.float64]
MIN_N = 0.3  # of the summary's frames
MIN_SHEAR = 0.1  # of the press, above which a frame has a shear and can have an error as a share of the shear
FLAT = ("twist", "punch", "ring")  # their touched area is not that of a ball
COLUMNS = {
    "contact": TEXT, "Fz, N": ".3f", "shear / Fz": ".2f", "Fz error": "+.1%", "z": "+.1f", "shear": ".1%",
    "z of shear": ".1f", "torque": ".1%", "z of torque": ".1f", "centre, um": ".0f", "radius": "+.0%",
    "utilisation": "+.3f", "regions": "d", "cold ms": ".1f", "warm ms": ".1f",
}  # fmt: skip
QUANTITIES = {
    "Fz": ("normal", "normal_z"), "shear / press": ("shear", "shear_z"), "shear / shear": ("of_shear", ""),
    "torque": ("torque", "torque_z"), "centre, mm": ("centre_mm", "centre_z"), "radius": ("radius", ""),
    "utilisation": ("utilisation", ""), "number of regions": ("regions_off", ""),
}  # fmt: skip


class Errors(NamedTuple):
    """One frame: errors as shares of the press, z in stated deviations, lengths in mm; NaN where there is none.

    The share of the torque is that of the largest torque of the press on its contact's radius and of the truth.
    """

    name: str
    press_n: float
    shear_share: float
    normal: float
    normal_z: float
    shear: float
    of_shear: float
    shear_z: Array
    torque: float
    torque_z: Array
    centre_mm: float
    centre_z: Array
    radius: float
    utilisation: float
    regions: int
    regions_off: int
    times_ms: tuple[float, float]


def errors_of(
    found: ContactForce, frame: dict[str, Array], name: str, times_ms: tuple[float, float]
) -> Errors:
    """The errors of one frame of the truth."""
    press, error = -float(frame["force_n"][2]), found.force_n - frame["force_n"]
    sigma, torque_sigma = (np.sqrt(np.diag(cov)) for cov in (found.force_cov_n2, found.torque_cov_nmm2))
    torque = found.torque_nmm - frame["torque_nmm"]
    radius_mm = float(np.sqrt(frame["area_mm2"][0] / np.pi))
    size = max(float(np.linalg.norm(frame["torque_nmm"])), press * radius_mm)
    off_mm, off_z, area_mm2 = np.full(2, np.nan), np.full(2, np.nan), np.nan
    if found.regions:
        nearest = min(
            found.regions, key=lambda region: float(np.hypot(*(region.centre_mm - frame["centre_mm"][0])))
        )
        off_mm, area_mm2 = nearest.centre_mm - frame["centre_mm"][0], nearest.area_mm2
        off_z = off_mm / np.sqrt(np.diag(nearest.centre_cov_mm2))
    shear_n, shear_error_n = float(np.hypot(*frame["force_n"][:2])), float(np.hypot(*error[:2]))
    return Errors(
        name=name,
        press_n=press,
        shear_share=shear_n / press,
        normal=-float(error[2]) / press,
        normal_z=float(error[2] / sigma[2]),
        shear=shear_error_n / press,
        of_shear=shear_error_n / shear_n if shear_n > MIN_SHEAR * press else np.nan,
        shear_z=error[:2] / sigma[:2],
        torque=float(np.linalg.norm(torque)) / size,
        torque_z=torque / torque_sigma,
        centre_mm=float(np.hypot(*off_mm)),
        centre_z=off_z,
        radius=np.nan if name in FLAT else float(np.sqrt(area_mm2 / np.pi)) / radius_mm - 1,
        utilisation=found.utilisation - float(frame["utilisation"]),
        regions=len(found.regions),
        regions_off=len(found.regions) - (2 if name == "two balls" else 1),
        times_ms=times_ms,
    )


@cache
def reader_of(thickness_mm: float, poisson: float, depth_mm: float, mirrored: bool = False) -> ContactReader:
    """The reader of the truth's pad; ``mirrored``: of the same pad, seen through its gel."""
    layout = build_layout(load_design("honeycomb", {"mirrored": "true"} if mirrored else {}))
    gel = make_gel(layout, Elastomer(thickness_mm, 1.0, poisson, depth_mm))
    return ContactReader(layout, gel, YOUNG_MPA, friction=FRICTION)


def read_case(
    case: Case,
    frames: list[dict[str, Array]],
    random: np.random.Generator,
    far_mm: float | None = None,
    depth_mm: float = 0.5,
    lost: float = 0.0,
) -> Iterator[Errors]:
    """The frames of a contact, read from two views' displacements, or from one view far away."""
    seen = seen_from(reader_of(case.thickness_mm, case.poisson, depth_mm), far_mm)
    for frame in frames:
        moved = frame["displacement_mm"][DEPTHS_MM.index(depth_mm)].astype(np.float64)
        seen.reader.reset()
        cold, warm = (timed(partial(seen.read, moved, random, lost)) for _ in range(2))
        yield errors_of(warm.result, frame, case.name, (cold.cpu_ms, warm.cpu_ms))


def summary(found: list[Errors]) -> Table:
    """Root mean square, worst and z of every error, of both halves."""
    fitted = {case.name for case in cases() if case.fitted}
    halves = {
        "fitted by": [one for one in found if one.name in fitted],
        "tested": [one for one in found if one.name not in fitted],
        "tested, no ring": [one for one in found if one.name not in fitted and one.name != "ring"],
        "all": found,
    }
    rows = []
    for half, mine in halves.items():
        for quantity, (name, z_name) in QUANTITIES.items():
            values = _known(getattr(one, name) for one in mine)
            z = _known(getattr(one, z_name) for one in mine) if z_name else np.empty(0)
            if len(values):
                worst = float(np.abs(values).max())
                rows.append(
                    (
                        half,
                        quantity,
                        len(values),
                        rms_of(values),
                        worst,
                        rms_of(z) if len(z) else None,
                    )
                )
    columns = {"frames": TEXT, "error of": TEXT, "number": "d", "rms": ".4f", "worst": ".4f", "z": ".2f"}
    return Table(f"frames above {MIN_N} N", columns, rows)


def _known(values: Iterable[float | Array]) -> Array:
    flat = np.concatenate([np.empty(0), *(np.atleast_1d(value) for value in values)])
    return flat[np.isfinite(flat)]


def measure(
    one_view: float | None = None,
    only: tuple[str, ...] = (),
    depth_mm: float = 0.5,
    lost: float = 0.0,
    rest: int = 2000,
    noises: int = 4,
    seed: int = 1,
) -> Shown:
    """One row for every frame, and the summary of all noises of the frames above 0.3 N.

    Args:
        one_view: distance of a single camera, mm; two views without it.
        only: names of contacts; all by default.
        depth_mm: of the markers: 0, 0.5 or 1.
        lost: share of the markers that have no displacement.
        rest: frames at rest in which a force is sought.
        noises: draws of the measurements' noise; the rows are those of the first draw.
    """
    with np.load(TRUTH) as file:
        truth = dict(file)
    random = np.random.default_rng(seed)
    found: list[Errors] = []
    for turn in range(noises):
        for case in cases():
            mine = np.flatnonzero(truth["case"] == case.name)
            if len(mine) and (not only or case.name in only):
                frames = [{key: values[k] for key, values in truth.items()} for k in mine]
                found += read_case(case, frames, random, one_view, depth_mm, lost)
        if turn == 0:
            yield Table("frames", COLUMNS, [row_of(one) for one in found])
    yield summary([one for one in found if one.press_n > MIN_N])
    times_ms = np.array([one.times_ms for one in found]).reshape(noises, -1, 2).min(axis=0)
    cold_ms, warm_ms = np.median(times_ms, axis=0)
    still = seen_from(reader_of(4.0, 0.5, depth_mm), one_view)
    touched = sum(
        still.read(np.zeros((len(still.reader.layout.xy_mm), 3)), random).regions != () for _ in range(rest)
    )
    yield f"at rest: a force in {touched} of {rest} frames"
    yield f"CPU of a frame, least of {noises}, median: cold {cold_ms:.1f} ms, warm {warm_ms:.1f} ms"


def row_of(one: Errors) -> tuple[object, ...]:
    """The row of ``COLUMNS``."""
    return (
        one.name, one.press_n, one.shear_share, one.normal, one.normal_z, one.shear, rms_of(one.shear_z), one.torque,
        rms_of(one.torque_z), 1e3 * one.centre_mm, one.radius, one.utilisation, one.regions, *one.times_ms,
    )  # fmt: skip


main = Experiment("force", measure)
main.run_as(__name__)
