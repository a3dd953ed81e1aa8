"""The figures of a job, for the report and the job sheet."""

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
    """Time and path length of a pass.

    Attributes:
        time_s: time from the bed's origin through all repeats back to the origin.
        burn_mm, travel_mm: lengths with and without beam, all repeats, without the moves from and to the origin.
        shortest_pause_s: shortest time between two neighbouring cells in one repeat; None without neighbours.
    """

    time_s: float
    burn_mm: float
    travel_mm: float
    shortest_pause_s: float | None


def pass_timing(job: LaserJob, laser_pass: LaserPass) -> PassTiming:
    """Compute the time of a pass from speed, travel speed, acceleration and repeats."""
    machine = job.setup.machine
    travel_speed, accel = machine.travel_mm_s.value, machine.acceleration_mm_s2.value
    time_s = burn_mm = travel_mm = 0.0
    pause: float | None = None
    # Repeats differ only in the direction of a pocket's hatch.
    distinct_repeats = laser_pass.repeats if laser_pass.fills else 1
    for repeat in range(distinct_repeats):
        strokes = laser_pass.burn_strokes(repeat)
        begin_s, end_s = begin_times_s(strokes, laser_pass.speed_mm_s, travel_speed, accel)
        return_mm = np.hypot(*(strokes.xy_mm[0] - strokes.xy_mm[-1]))
        count = laser_pass.repeats / distinct_repeats
        returns = count - (repeat == 0)
        time_s += count * end_s + returns * float(move_times_s(np.array([return_mm]), travel_speed, accel)[0])
        burn_mm += count * float(stroke_lengths_mm(strokes).sum())
        travel_mm += count * float(travel_lengths_mm(strokes).sum()) + returns * float(return_mm)
        if laser_pass.cavities is not None and repeat == 0:
            firsts = np.searchsorted(strokes.owner, np.arange(len(laser_pass.cavities.cell)))
            centres = laser_pass.cavities.nominal_mm.mean(axis=1)
            shortest = shortest_pause(np.arange(len(centres)), centres, begin_s[firsts])
            pause = shortest if np.isfinite(shortest) else None
    first_repeat = laser_pass.burn_strokes(0)
    to_and_from_origin = np.hypot(*first_repeat.xy_mm[0]), np.hypot(*first_repeat.xy_mm[-1])
    time_s += float(move_times_s(np.array(to_and_from_origin), travel_speed, accel).sum())
    return PassTiming(
        round(time_s, 3), round(burn_mm, 3), round(travel_mm, 3), None if pause is None else round(pause, 3)
    )


def job_figures(
    job: LaserJob, as_made: tuple[PassFigures, ...], timings: tuple[PassTiming, ...]
) -> dict[str, Any]:
    """The job's member of ``report.json``; lengths in mm, times in s, areas in percent of the nominal cells."""
    setup, by_name = job.setup, {figures.name: figures for figures in as_made}
    return {
        "machine": setup.machine.name,
        "material": setup.material.name,
        "mode": setup.options.mode,
        "corner": setup.options.corner if setup.compensated else "plain",
        "compensated": setup.compensated,
        "order": setup.options.order,
        "nominal_face": job.nominal_face,
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
        "time_s": round(sum(timing.time_s for timing in timings), 3),
        "passes": [
            _pass_figures(laser_pass, timing, by_name.get(laser_pass.name))
            for laser_pass, timing in zip(job.passes, timings, strict=True)
        ],
    }


def _pass_figures(laser_pass: LaserPass, timing: PassTiming, as_made: PassFigures | None) -> dict[str, Any]:
    faces = {}
    if as_made is not None:
        faces = {"front": asdict(as_made.front), "back": as_made.back and asdict(as_made.back)}
    return {
        "name": laser_pass.name,
        "paths": len(laser_pass.walls),
        "power_percent": laser_pass.power_percent,
        "speed_mm_s": laser_pass.speed_mm_s,
        "repeats": laser_pass.repeats,
        **asdict(timing),
        **faces,
    }
