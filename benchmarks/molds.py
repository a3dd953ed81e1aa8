"""Molds: time of each operation over the number of bosses, against boolean operations, and of whole processes.

    python -m benchmarks.molds            plates, booleans, a pad of 22 layers
    python -m benchmarks.molds --large    and a pad of 44 layers
    python -m benchmarks.molds --quick    small plates and a small pad, as a test

Times are of one core (user and system time, the least of some runs), because these depend less on the machine's load.
Whole processes show wall time too. A large mold is made by two processes: its core seconds are the sum of both, its
memory is that of the larger process.
"""

from __future__ import annotations

import argparse
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

from benchmarks.support.machine import conditions_text, write_json
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


def time_call(operation: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of processor time, and the operation's result."""
    start = time.process_time()
    result = operation()
    return time.process_time() - start, result


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
        seconds, result = time_call(operation)
        times.append(seconds)
        return result

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

    seconds, shape = time_call(build)
    checked, _ = time_call(lambda: measure_solid(shape))
    written, data = time_call(lambda: solid_to_step(NamedSolid("plate", "#c8322d", shape)))
    read, _ = time_call(lambda: read_step(data))
    return [seconds, checked, written, read]


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


def measure_plates(quick: bool) -> dict[str, Any]:
    """Measure and print boss plates, directly and by booleans."""
    make_slab_solid(red_plate_slab(2))  # loads the kernel's libraries before times are measured
    many, compared = (QUICK_LAYERS, QUICK_BOOLEAN_LAYERS) if quick else (LAYERS, BOOLEAN_LAYERS)
    print("Boss plates, seconds of one core")
    print(
        f"{'bosses':>8}" + "".join(f"{operation:>10}" for operation in OPERATIONS) + f"{'volume off by':>16}"
    )
    counts, table = [], []
    for layers in many:
        plate = least_times(layers, RUNS if layers <= compared and not quick else 1)
        counts.append(plate.bosses)
        table.append(plate.seconds)
        row = "".join(f"{t:>10.3f}" for t in plate.seconds)
        print(f"{plate.bosses:>8}{row}{plate.volume_error:>16.1e}", flush=True)
    slopes = [float(np.polyfit(np.log(counts), np.log(column), 1)[0]) for column in np.array(table).T]
    print(f"{'exponent':>8}" + "".join(f"{slope:>10.2f}" for slope in slopes) + f"   limit {EXPONENT_LIMIT}")
    direct = table[many.index(compared)][1:]
    boolean = measure_boolean(compared)
    print(
        f"\nBooleans, {compared**2} bosses"
        + " " * 3
        + "".join(f"{operation:>10}" for operation in OPERATIONS[1:])
    )
    print(f"{'boolean':>24}" + "".join(f"{t:>10.3f}" for t in boolean))
    print(f"{'direct':>24}" + "".join(f"{t:>10.3f}" for t in direct))
    print(
        f"{'ratio':>24}" + "".join(f"{b / a:>10.1f}" for a, b in zip(direct, boolean, strict=True)),
        flush=True,
    )
    seconds = {
        bosses: dict(zip(OPERATIONS, times, strict=True)) for bosses, times in zip(counts, table, strict=True)
    }
    exponents = dict(zip(OPERATIONS, slopes, strict=True))
    booleans = {compared**2: dict(zip(OPERATIONS[1:], boolean, strict=True))}
    return {"seconds": seconds, "exponents": exponents, "booleans": booleans}


def measure_processes(sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    """Measure and print whole processes for pads of these numbers of layers."""
    print("\nWhole processes: cmpdesign build honeycomb --only mold")
    print(f"{'layers':>8}{'cells':>8}{'wall s':>10}{'core s':>10}{'GB':>8}  digest of the files")
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for layers in sizes:
            one = measure_process(layers, Path(folder))
            times = f"{one.wall_s:>10.1f}{one.core_s:>10.1f}{one.memory_gb:>8.2f}"
            print(f"{layers:>8}{3 * layers**2:>8}{times}  {one.digest}", flush=True)
            found.append(
                {
                    "layers": layers,
                    "wall_s": one.wall_s,
                    "core_s": one.core_s,
                    "gb": one.memory_gb,
                    "digest": one.digest,
                }
            )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Molds: time, memory and growth.")
    parser.add_argument("--quick", action="store_true", help="small plates and a small pad")
    parser.add_argument("--large", action="store_true", help="a pad of 44 layers, too")
    parser.add_argument("--json", type=Path, help="write conditions and figures to this file")
    options = parser.parse_args()
    print(conditions_text())
    figures = measure_plates(options.quick)
    sizes = (2, 2) if options.quick else (22, 22, 44) if options.large else (22, 22)
    figures["processes"] = measure_processes(sizes)
    if options.json:
        write_json(options.json, figures)


if __name__ == "__main__":
    main()
