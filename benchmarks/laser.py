"""Laser jobs: travel against vpype, time to write all formats, areas over kerf.

Travel is for 2,000 cells in three colors and one white, with the job's paths. Times are to all files of laser/ in
memory, from a layout; processor time excludes waiting. Areas are as made at the front, honeycomb of 1.5 mm. vpype needs
old packages; therefore it is installed in its own environment on the first run.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
from cmpdesign.design.design import Design, load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.products.laser.as_made import measure_as_made
from cmpdesign.products.laser.formats.drawing import job_drawing
from cmpdesign.products.laser.formats.svg import drawing_to_svg
from cmpdesign.products.laser.job import LaserJob, LaserPass, make_job
from cmpdesign.products.laser.library import machines
from cmpdesign.products.laser.make import prepare_laser
from cmpdesign.products.laser.paths.beam import Points
from cmpdesign.products.laser.paths.order import order_cells
from cmpdesign.products.laser.paths.strokes import loop_strokes
from cmpdesign.products.laser.setup import complete_setup

VPYPE_HOME = Path(sys.prefix) / "vpype"
PX_IN_MM = 96 / 25.4


def make_design(layers: int, **options: str) -> Design:
    """A honeycomb with a pitch of 1.5 mm on a sufficiently large bed; n layers have 3 n^2 + 1 carved cells."""
    given = {"layers": str(layers), "pitch_mm": "1.5", "laser.machine": "co2-40w", "fiducials.count": "0"}
    return load_design("honeycomb", given | {key.replace("__", "."): value for key, value in options.items()})


def make_laser_job(design: Design) -> LaserJob:
    """The laser job of a design."""
    return make_job(design.name, build_layout(design), complete_setup(design.laser))


def travel_mm(job: LaserJob) -> float:
    """Length of the travel with the beam off between the cells of every pass, in the order of burning."""
    total = 0.0
    for laser_pass in job.cell_passes:
        starts = laser_pass.walls.xy_mm[laser_pass.walls.first[:-1]]
        total += float(np.hypot(*np.diff(starts, axis=0).T).sum())
    return total


def nearest_bound_mm(entries_mm: Points) -> float:
    """A lower bound of the travel in mm: every cell but one is reached from another cell, at best from the nearest."""
    if len(entries_mm) < 2:
        return 0.0
    points, owner = entries_mm.reshape(-1, 2), np.repeat(np.arange(len(entries_mm)), entries_mm.shape[1])
    distance, near = cKDTree(points).query(points, k=min(12, len(points)))
    distance = np.where(owner[near] == owner[:, None], np.inf, distance).min(axis=1)
    nearest = distance.reshape(len(entries_mm), -1).min(axis=1)
    return float(nearest.sum() - nearest.max())


def pass_in_layout_order(laser_pass: LaserPass) -> LaserPass:
    """The pass with its closed paths in the layout's order, each starting at its first corner."""
    assert laser_pass.cavities is not None
    cells = laser_pass.cavities.selected(np.argsort(laser_pass.cavities.cell))
    return replace(laser_pass, walls=loop_strokes(cells.loops_mm, np.arange(len(cells.cell))))


def vpype_mm(job: LaserJob, *options: str) -> tuple[float, float]:
    """Travel in mm and time in s of vpype's linesort on the same paths, in the layout's order."""
    program = VPYPE_HOME / "bin" / "vpype"
    if not program.exists():
        venv.create(VPYPE_HOME, with_pip=True)
        pip = [str(VPYPE_HOME / "bin" / "pip"), "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "vpype==1.15.0"], check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cells.svg"
        path.write_text(
            drawing_to_svg(
                replace(job_drawing(job), passes=tuple(map(pass_in_layout_order, job.cell_passes)))
            )
        )
        command = [str(program), "read", str(path), "linesort", *options, "stat"]
        done = timed(lambda: subprocess.run(command, check=True, capture_output=True, text=True))
    lines = done.result.stdout.splitlines()
    total = [line for line in lines if line.strip().startswith("Pen-up length:")][-1]
    return float(total.split(":")[1]) / PX_IN_MM, done.clock_ms / 1e3


def travel_table() -> Table:
    """vpype's travel and the job's; the job's is at least 12 % shorter."""
    job = make_laser_job(make_design(26, laser__corner="plain", laser__holes="false"))
    entries = [one.cavities.entries_mm for one in job.cell_passes if one.cavities is not None]
    seconds = timed(lambda: [order_cells(cells, "travel") for cells in entries]).clock_ms / 1e3
    bound = sum(nearest_bound_mm(cells) for cells in entries)
    plain, plain_s = vpype_mm(job)
    best, best_s = vpype_mm(job, "--two-opt")
    own = travel_mm(job)
    assert own < 0.88 * best, "at least 12 % below"
    found = [("vpype linesort", plain, plain_s), ("vpype linesort --two-opt", best, best_s)]
    found += [("cmpdesign", own, seconds), ("lower bound (nearest neighbours)", bound, 0.0)]
    rows = [(name, length / 1000, 100 * (length / best - 1), spent_s) for name, length, spent_s in found]
    title = f"travel on {sum(map(len, entries))} cells in {len(entries)} passes"
    return Table(title, {"": TEXT, "m": ".3f", "% over two-opt": "+.1f", "s": ".2f"}, rows)


def format_times_table() -> Table:
    """Times within their limits, and the same bytes twice."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        machine = Path(folder) / "co2-40w.toml"
        text = machines()["co2-40w"].read_text().replace("value = 300.0", "value = 900.0")
        small = 'value = 200.0, source = "assumed: the common small'
        machine.write_text(text.replace(small, small.replace("200", "600")))
        for layers, limit in ((26, 3.0), (82, 30.0)):
            design = make_design(layers, laser__machine=str(machine), fiducials__count="3")
            layout = build_layout(design)
            made = timed(lambda: prepare_laser(design, layout).make().files)  # noqa: B023
            files, seconds, wall = made.result, made.cpu_ms / 1e3, made.clock_ms / 1e3
            passes = make_job("", layout, complete_setup(design.laser)).cell_passes
            size = sum(len(content) for content in files.values()) / 1e6
            rows.append((sum(len(one.walls) for one in passes), len(files), size, seconds, wall, limit))
            assert seconds < limit
            assert files == prepare_laser(design, layout).make().files, "the same bytes twice"
    columns = {"cells": "d", "files": "d", "MB": ".1f", "CPU s": ".2f", "wall s": ".2f", "limit s": ".0f"}
    return Table("all files of laser/ (figures, 4 formats, sheet, coupon), corners overcut", columns, rows)


def areas_table() -> Table:
    """Areas against the nominal cell, losses at corners, and burns outside the cell."""
    rows = []
    for kerf in (0.03, 0.05, 0.1, 0.16, 0.25):
        for corner in ("plain", "overcut"):
            options = {"laser__corner": corner, "laser__kerf_mm": str(kerf), "laser__taper_deg": "0"}
            front = measure_as_made(make_laser_job(make_design(4, **options)))[1].front
            lengths_mm = front.corner_loss_mm, front.burnt_beside_mm, front.web_mm, front.web_to_filled_mm
            rows.append((corner, kerf, front.area_error_percent, *(1000 * (mm or 0) for mm in lengths_mm)))
            assert abs(front.area_error_percent) < 0.6 or (corner == "plain" and kerf > 0.1)
    columns = {
        "corner": TEXT,
        "kerf mm": ".2f",
        "area %": "+.3f",
        "corner lost um": ".1f",
        "beside um": ".1f",
    }
    return Table("as made", columns | {"web um": ".1f", "web to filled um": ".1f"}, rows)


def measure() -> Shown:
    """All figures."""
    prepare_laser(make_design(3), build_layout(make_design(3))).make()  # loads what is loaded on first use
    yield areas_table()
    yield travel_table()
    yield format_times_table()


main = Experiment("laser", measure)
main.run_as(__name__)
