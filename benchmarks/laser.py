"""Laser jobs: travel against vpype, time to write all formats, areas over kerf. One run prints all figures.

vpype needs old packages; therefore it is installed in its own environment on the first run.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import venv
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from cmpdesign.design.design import Design, load_design
from cmpdesign.layout.build import build_layout
from cmpdesign.products.laser.as_made import measure_as_made
from cmpdesign.products.laser.formats.drawing import job_drawing
from cmpdesign.products.laser.formats.svg import drawing_to_svg
from cmpdesign.products.laser.job import LaserJob, LaserPass, make_job
from cmpdesign.products.laser.make import make_laser
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
        pip = [
            str(VPYPE_HOME / "bin" / "pip"),
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "vpype==1.15.0",
        ]
        subprocess.run(pip, check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cells.svg"
        path.write_text(
            drawing_to_svg(
                replace(job_drawing(job), passes=tuple(map(pass_in_layout_order, job.cell_passes)))
            )
        )
        started = time.perf_counter()
        command = [str(program), "read", str(path), "linesort", *options, "stat"]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        seconds = time.perf_counter() - started
    total = [line for line in text.splitlines() if line.strip().startswith("Pen-up length:")][-1]
    return float(total.split(":")[1]) / PX_IN_MM, seconds


def print_travel() -> None:
    """Print the travel for 2,000 cells in three colors (and one white), with the job's paths."""
    job = make_laser_job(make_design(26, laser__corner="plain", laser__holes="false"))
    entries = [
        laser_pass.cavities.entries_mm for laser_pass in job.cell_passes if laser_pass.cavities is not None
    ]
    started = time.perf_counter()
    for cells in entries:
        order_cells(cells, "travel")
    seconds = time.perf_counter() - started
    bound = sum(nearest_bound_mm(cells) for cells in entries)
    plain, plain_s = vpype_mm(job)
    best, best_s = vpype_mm(job, "--two-opt")
    own = travel_mm(job)
    print(f"\ntravel on {sum(map(len, entries))} cells in {len(entries)} passes")
    print(f"{'':34}{'m':>8}{'against two-opt':>18}{'s':>8}")
    rows = [("vpype linesort", plain, plain_s), ("vpype linesort --two-opt", best, best_s)]
    rows += [("cmpdesign", own, seconds), ("lower bound (nearest neighbours)", bound, 0.0)]
    for name, length, seconds_of in rows:
        print(f"{name:34}{length / 1000:8.3f}{100 * (length / best - 1):+17.1f} %{seconds_of:8.2f}")
    assert own < 0.88 * best, "at least 12 % below"


def print_format_times() -> None:
    """Print the time to make all files of the folder laser/ in memory, from a layout. CPU time excludes waiting."""
    print("\ntime to everything in laser/ (figures, 4 formats, sheet, coupon), corners overcut")
    print(f"{'cells':>8}{'files':>8}{'MB':>8}{'CPU s':>8}{'wall s':>8}{'limit s':>9}")
    with tempfile.TemporaryDirectory() as folder:
        machine = Path(folder) / "co2-40w.toml"
        from cmpdesign.products.laser.library import machines

        text = machines()["co2-40w"].read_text()
        machine.write_text(
            text.replace("value = 300.0", "value = 900.0").replace(
                'value = 200.0, source = "assumed: the common small',
                'value = 600.0, source = "assumed: the common small',
            )
        )
        for layers, limit in ((26, 3.0), (82, 30.0)):
            design = make_design(layers, laser__machine=str(machine), fiducials__count="3")
            layout = build_layout(design)
            started, begun = time.perf_counter(), time.process_time()
            files = make_laser(design, layout).files
            wall, seconds = time.perf_counter() - started, time.process_time() - begun
            size = sum(len(content) for content in files.values()) / 1e6
            cells = sum(
                len(one.walls) for one in make_job("", layout, complete_setup(design.laser)).cell_passes
            )
            print(f"{cells:8d}{len(files):8d}{size:8.1f}{seconds:8.2f}{wall:8.2f}{limit:9.0f}")
            assert seconds < limit
            assert files == make_laser(design, layout).files, "the same bytes twice"


def print_areas() -> None:
    """Print areas against the nominal cell of 1.5 mm, losses at corners, and burns outside the cell."""
    print("\nas made at the front, honeycomb of 1.5 mm")
    print(
        f"{'kerf mm':>9}{'corner':>10}{'area %':>10}{'corner lost um':>16}{'beside um':>11}{'web um':>9}"
        f"{'web to filled um':>18}"
    )
    for kerf in (0.03, 0.05, 0.1, 0.16, 0.25):
        for corner in ("plain", "overcut"):
            job = make_laser_job(
                make_design(4, laser__corner=corner, laser__kerf_mm=str(kerf), laser__taper_deg="0")
            )
            front = measure_as_made(job)[1].front
            lengths = [
                front.corner_loss_mm,
                front.burnt_beside_mm,
                front.web_mm or 0,
                front.web_to_filled_mm or 0,
            ]
            row = "".join(
                f"{1000 * value:{width}.1f}" for value, width in zip(lengths, (16, 11, 9, 18), strict=True)
            )
            print(f"{kerf:9.2f}{corner:>10}{front.area_error_percent:+10.3f}{row}")
            assert abs(front.area_error_percent) < 0.6 or (corner == "plain" and kerf > 0.1)


def main() -> None:
    print(json.dumps({"python": sys.version.split()[0]}))
    make_laser(make_design(3), build_layout(make_design(3)))  # loads what is loaded on first use
    print_areas()
    print_travel()
    print_format_times()


if __name__ == "__main__":
    main()
