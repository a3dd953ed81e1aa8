"""Molds: time of each operation over the number of bosses, against boolean operations, and of whole processes.

Times are of one core (user and system time, the least of some runs), because these depend less on the machine's load.
Whole processes show wall time too. A large mold is made by two processes: its core seconds are the sum of both, its
memory is that of the larger process.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.frame.experiment import Experiment, Shown
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import timed
from cmpdesign import build_layout, load
from cmpdesign.patterns.colors import RED
from cmpdesign.products.mold.parts import make_parts
from cmpdesign.products.mold.solids.measure import measure_solid
from cmpdesign.products.mold.solids.slab_shells import Feature, Slab, make_slab_solid, slab_volume_mm3
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.mold.step.step import NamedSolid, read_step, solid_to_step

LAYERS, QUICK_LAYERS = (10, 20, 39, 60), (3, 6)
# Runs of plates up to the size of the boolean comparison; larger plates are run once.
RUNS = 3
OPERATIONS = ("describe", "build", "check", "write", "read")
BOOLEAN_LAYERS, QUICK_BOOLEAN_LAYERS = 39, 6
EXPONENT_LIMIT = 1.15


class PlateFigures(NamedTuple):
    """One plate: bosses, seconds by ``OPERATIONS``, and the relative error of the volume that is read back."""

    bosses: int
    seconds: list[float]
    volume_error: float


class ProcessFigures(NamedTuple):
    """One process: wall and core seconds, peak memory in GB, a digest of all files."""

    wall_s: float
    core_s: float
    memory_gb: float
    digest: str


def red_plate_slab(layers: int) -> Slab:
    """The slab of the boss plate of the red cells."""
    design = load("honeycomb", {"layers": str(layers)})
    parts = make_parts(make_stack(design, build_layout(design)))
    slab = next(part.slab for part in parts if part.color_number == RED)
    assert slab is not None
    return slab


def measure_direct(layers: int) -> PlateFigures:
    """The figures of one plate; the volume's error is relative to its closed form."""
    times = []

    def lap(operation: Callable[[], Any]) -> Any:
        done = timed(operation)
        times.append(done.cpu_ms / 1e3)
        return done.result

    slab = lap(lambda: red_plate_slab(layers))
    solid = lap(lambda: make_slab_solid(slab))
    found = lap(lambda: measure_solid(solid))
    data = lap(lambda: solid_to_step(NamedSolid("plate", "#c8322d", solid)))
    again = lap(lambda: read_step(data))
    back = measure_solid(again)
    assert found.valid and found.closed and back.valid and back.closed
    return PlateFigures(len(slab.many), times, abs(back.volume_mm3 / slab_volume_mm3(slab) - 1))


def measure_boolean(layers: int) -> list[float]:
    """Seconds by ``OPERATIONS[1:]`` of the same plate, as one fuse of a plain slab and all bosses, sunk by 0.1 mm."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.collections import List_TopoDS_Shape

    slab = red_plate_slab(layers)

    def build() -> Any:
        plain = Slab(slab.outer, slab.bottom_mm, slab.top_mm, slab.through)
        arguments, tools = List_TopoDS_Shape(), List_TopoDS_Shape()
        arguments.Append(make_slab_solid(plain))
        for boss in slab.many:
            tools.Append(boss_solid(boss))
        fuse = BRepAlgoAPI_Fuse()
        fuse.SetArguments(arguments)
        fuse.SetTools(tools)
        fuse.Build()
        return fuse.Shape()

    built = timed(build)
    checked = timed(lambda: measure_solid(built.result))
    written = timed(lambda: solid_to_step(NamedSolid("plate", "#c8322d", built.result)))
    read = timed(lambda: read_step(written.result))
    return [one.cpu_ms / 1e3 for one in (built, checked, written, read)]


def boss_solid(boss: Feature) -> Any:
    """A boss as a separate solid that reaches 0.1 mm below the plate's face."""
    return make_slab_solid(Slab(boss.root, -0.1, boss.height_mm, outer_top=boss.tip))


def measure_process(layers: int, folder: Path) -> ProcessFigures:
    """The figures of ``build --only mold``."""
    command = [sys.executable, "-c", "from cmpdesign.cli import main; main()", "build", "honeycomb"]
    command += ["--set", f"layers={layers}", "--only", "mold", "-o", str(folder)]
    start = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    wall = time.perf_counter() - start
    child.returncode = status
    assert status == 0
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.step")):
        digest.update(path.name.encode() + path.read_bytes())
    core_s = usage.ru_utime + usage.ru_stime
    return ProcessFigures(wall, core_s, usage.ru_maxrss / 2**20, digest.hexdigest()[:16])


def least_times(layers: int, runs: int) -> PlateFigures:
    """The figures of one plate with the least seconds of each operation over some runs."""
    found = [measure_direct(layers) for _ in range(runs)]
    seconds = np.array([figures.seconds for figures in found]).min(axis=0).tolist()
    return PlateFigures(found[0].bosses, seconds, max(figures.volume_error for figures in found))


def measure(quick: bool = False, large: bool = False) -> Shown:
    """Plates, booleans, and whole processes.

    Args:
        quick: small plates and a small pad, as a test.
        large: a pad of 44 layers, too.
    """
    make_slab_solid(red_plate_slab(2))  # loads the kernel's libraries before times are measured
    many, compared = (QUICK_LAYERS, QUICK_BOOLEAN_LAYERS) if quick else (LAYERS, BOOLEAN_LAYERS)
    plates = {layers: least_times(layers, RUNS if layers <= compared and not quick else 1) for layers in many}
    counts = np.log([plate.bosses for plate in plates.values()])
    seconds = np.log([plate.seconds for plate in plates.values()])
    slopes = [float(np.polyfit(counts, column, 1)[0]) for column in seconds.T]
    rows = [(str(plate.bosses), *plate.seconds, plate.volume_error) for plate in plates.values()]
    rows.append(("exponent", *slopes, None))
    columns = {"bosses": TEXT, **dict.fromkeys(OPERATIONS, ".3f"), "volume off by": ".1e"}
    yield Table("boss plates, seconds of one core", columns, rows, f"limit of exponents {EXPONENT_LIMIT}")
    direct, boolean = plates[compared].seconds[1:], measure_boolean(compared)
    ratios = [b / a for a, b in zip(direct, boolean, strict=True)]
    found = [("boolean", *boolean), ("direct", *direct), ("ratio", *ratios)]
    columns = {"": TEXT, **dict.fromkeys(OPERATIONS[1:], ".3f")}
    yield Table(f"booleans, {compared**2} bosses", columns, found)
    processes = []
    with tempfile.TemporaryDirectory() as folder:
        for layers in (2, 2) if quick else (22, 22, 44) if large else (22, 22):
            processes.append((layers, 3 * layers**2, *measure_process(layers, Path(folder))))
    columns = {"layers": "d", "cells": "d", "wall s": ".1f", "core s": ".1f", "GB": ".2f", "digest": TEXT}
    yield Table("whole processes: cmpdesign build honeycomb --only mold", columns, processes)


main = Experiment("molds", measure)
main.run_as(__name__)
