"""The job in figures: for the report, the job sheet and whoever reads either."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cmpdesign.products.laser.as_made import PassFigures
from cmpdesign.products.laser.job import LaserJob, LaserPass
from cmpdesign.products.laser.paths.order import shortest_pause
from cmpdesign.products.laser.paths.timing import (
    begin_times_s,
    move_times_s,
    stroke_lengths_mm,
    travel_lengths_mm,
)


@dataclass(frozen=True)
class PassTiming:
    """A pass in time and length.

    Attributes:
        time_s: from the start at the bed's origin until the head is back there, all repeats.
        burn_mm, travel_mm: lengths with and without beam, all repeats, without the ways from and to the
        origin.
        shortest_pause_s: the shortest time between two neighbouring cells in one repeat; None for lone cells.
    """

    time_s: float
    burn_mm: float
    travel_mm: float
    shortest_pause_s: float | None


def pass_timing(job: LaserJob, one: LaserPass) -> PassTiming:
    """The time that a pass takes, from speed, travel, acceleration and repeats."""
    machine = job.setup.machine
    travel_speed, accel = machine.travel_mm_s.value, machine.acceleration_mm_s2.value
    time_s = burn_mm = travel_mm = 0.0
    pause: float | None = None
    # Repeats differ only where a pocket's lines turn.
    different = one.repeats if one.fills else 1
    for repeat in range(different):
        strokes = one.burnt(repeat)
        begun, ended = begin_times_s(strokes, one.speed_mm_s, travel_speed, accel)
        back = np.hypot(*(strokes.xy_mm[0] - strokes.xy_mm[-1]))
        times = one.repeats / different
        returns = times - (repeat == 0)
        time_s += times * ended + returns * float(move_times_s(np.array([back]), travel_speed, accel)[0])
        burn_mm += times * float(stroke_lengths_mm(strokes).sum())
        travel_mm += times * float(travel_lengths_mm(strokes).sum()) + returns * float(back)
        if one.cavities is not None and repeat == 0:
            firsts = np.searchsorted(strokes.owner, np.arange(len(one.cavities.cell)))
            centres = one.cavities.nominal_mm.mean(axis=1)
            found = shortest_pause(np.arange(len(centres)), centres, begun[firsts])
            pause = found if np.isfinite(found) else None
    ways = np.hypot(*one.burnt(0).xy_mm[0]), np.hypot(*one.burnt(0).xy_mm[-1])
    time_s += float(move_times_s(np.array(ways), travel_speed, accel).sum())
    return PassTiming(
        round(time_s, 3), round(burn_mm, 3), round(travel_mm, 3), None if pause is None else round(pause, 3)
    )


def job_figures(
    job: LaserJob, made: tuple[PassFigures, ...], timings: tuple[PassTiming, ...]
) -> dict[str, Any]:
    """The job's member of ``report.json``; lengths in mm, times in s, areas in percent of the nominal
    cells."""
    setup, by_name = job.setup, {one.name: one for one in made}
    return {
        "machine": setup.machine.name,
        "material": setup.material.name,
        "mode": setup.options.mode,
        "corner": setup.options.corner,
        "order": setup.options.order,
        "nominal_face": setup.options.face,
        "kerf_front_mm": [round(width, 6) for width in job.front.kerf_mm],
        "kerf_back_mm": [round(width, 6) for width in job.back.kerf_mm],
        "taper_deg": setup.taper_deg,
        "depth_mm": setup.depth_mm,
        "minimum_web_mm": setup.minimum_web_mm,
        "assumed": list(setup.assumed),
        "bed_mm": [setup.machine.bed_width_mm.value, setup.machine.bed_height_mm.value],
        "extent_mm": [round(value, 4) for value in job.extent_mm],
        "layout_origin_mm": job.origin_mm.tolist(),
        "fiducials_mm": job.fiducials_mm.round(6).tolist(),
        "time_s": round(sum(one.time_s for one in timings), 3),
        "passes": [
            _pass_figures(one, time, by_name.get(one.name))
            for one, time in zip(job.passes, timings, strict=True)
        ],
    }


def _pass_figures(one: LaserPass, time: PassTiming, made: PassFigures | None) -> dict[str, Any]:
    return {
        "name": one.name,
        "paths": len(one.walls),
        "power_percent": one.power_percent,
        "speed_mm_s": one.speed_mm_s,
        "repeats": one.repeats,
        **asdict(time),
        **({} if made is None else {"front": asdict(made.front), "back": made.back and asdict(made.back)}),
    }
