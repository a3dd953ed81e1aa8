"""Molds: time of each step over the number of bosses, the boolean way beside it, and whole processes.

    python -m benchmarks.molds            plates, booleans, a pad of 22 layers
    python -m benchmarks.molds --large    and one of 44
    python -m benchmarks.molds --quick    small ones, to see that it runs

Times are of one core (user and system time; the least of some runs), so that a busy machine blurs them less; whole
processes show wall time too. A large mold is made by two processes: its core seconds are of both, its memory of the
larger one.
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
from typing import Any

import numpy as np

from benchmarks.support.machine import conditions_text, write_json
from cmpdesign import build_layout, load_design
from cmpdesign.patterns.colors import RED
from cmpdesign.products.mold.parts import make_parts
from cmpdesign.products.mold.solids.measure import measure_solid
from cmpdesign.products.mold.solids.slab_shells import Feature, Slab, make_slab_solid, slab_volume_mm3
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.mold.step.step import NamedSolid, read_step, solid_to_step

LAYERS, QUICK_LAYERS = (10, 20, 39, 60), (3, 6)
# Runs of plates up to the boolean one's size; the larger one is run once.
RUNS = 3
STEPS = ("describe", "build", "check", "write", "read")
BOOLEAN_LAYERS, QUICK_BOOLEAN_LAYERS = 39, 6
EXPONENT_LIMIT = 1.15


def time_call(step: Callable[[], Any]) -> tuple[float, Any]:
    start = time.process_time()
    result = step()
    return time.process_time() - start, result


def red_plate_slab(layers: int) -> Slab:
    design = load_design("honeycomb", {"layers": str(layers)})
    parts = make_parts(make_stack(design, build_layout(design)))
    slab = next(part.slab for part in parts if part.color_number == RED)
    assert slab is not None
    return slab


def measure_direct(layers: int) -> tuple[int, list[float], float]:
    """Bosses, seconds of each step, and how far the volume read back is off its closed form."""
    times = []

    def lap(step: Callable[[], Any]) -> Any:
        seconds, result = time_call(step)
        times.append(seconds)
        return result

    slab = lap(lambda: red_plate_slab(layers))
    solid = lap(lambda: make_slab_solid(slab))
    found = lap(lambda: measure_solid(solid))
    data = lap(lambda: solid_to_step(NamedSolid("plate", "#c8322d", solid)))
    again = lap(lambda: read_step(data))
    back = measure_solid(again)
    assert found.valid and found.closed and back.valid and back.closed
    return len(slab.many), times, abs(back.volume_mm3 / slab_volume_mm3(slab) - 1)


def measure_boolean(layers: int) -> list[float]:
    """The same plate by one general fuse of a plain slab and all bosses, sunk a little into it."""
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
    """A boss as a solid of its own, reaching 0.1 mm below the plate's face."""
    return make_slab_solid(Slab(boss.root, -0.1, boss.height_mm, outer_top=boss.tip))


def measure_process(layers: int, folder: Path) -> tuple[float, float, float, str]:
    """``build --only mold``: wall and core seconds, peak memory in GB, a digest of all files."""
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
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 2**20, digest.hexdigest()[:16]


def least_times(layers: int, runs: int) -> tuple[int, list[float], float]:
    """The least seconds of each step over some runs."""
    found = [measure_direct(layers) for _ in range(runs)]
    times = np.array([times for _, times, _ in found]).min(axis=0).tolist()
    return found[0][0], times, max(error for _, _, error in found)


def measure_plates(quick: bool) -> dict[str, Any]:
    make_slab_solid(red_plate_slab(2))  # the kernel's libraries are loaded before the clock runs
    many, compared = (QUICK_LAYERS, QUICK_BOOLEAN_LAYERS) if quick else (LAYERS, BOOLEAN_LAYERS)
    print("Boss plates, seconds of one core")
    print(f"{'bosses':>8}" + "".join(f"{step:>10}" for step in STEPS) + f"{'volume off by':>16}")
    counts, table = [], []
    for layers in many:
        bosses, times, error = least_times(layers, RUNS if layers <= compared and not quick else 1)
        counts.append(bosses)
        table.append(times)
        print(f"{bosses:>8}" + "".join(f"{t:>10.3f}" for t in times) + f"{error:>16.1e}", flush=True)
    slopes = [float(np.polyfit(np.log(counts), np.log(column), 1)[0]) for column in np.array(table).T]
    print(f"{'exponent':>8}" + "".join(f"{slope:>10.2f}" for slope in slopes) + f"   limit {EXPONENT_LIMIT}")
    ours = table[many.index(compared)][1:]
    other = measure_boolean(compared)
    print(f"\nBooleans, {compared**2} bosses" + " " * 3 + "".join(f"{step:>10}" for step in STEPS[1:]))
    print(f"{'boolean':>24}" + "".join(f"{t:>10.3f}" for t in other))
    print(f"{'direct':>24}" + "".join(f"{t:>10.3f}" for t in ours))
    print(f"{'ratio':>24}" + "".join(f"{b / a:>10.1f}" for a, b in zip(ours, other, strict=True)), flush=True)
    seconds = {
        bosses: dict(zip(STEPS, times, strict=True)) for bosses, times in zip(counts, table, strict=True)
    }
    exponents = dict(zip(STEPS, slopes, strict=True))
    booleans = {compared**2: dict(zip(STEPS[1:], other, strict=True))}
    return {"seconds": seconds, "exponents": exponents, "booleans": booleans}


def measure_processes(sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    print("\nWhole processes: cmpdesign build honeycomb --only mold")
    print(f"{'layers':>8}{'cells':>8}{'wall s':>10}{'core s':>10}{'GB':>8}  digest of the files")
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for layers in sizes:
            wall, core, memory, digest = measure_process(layers, Path(folder))
            print(
                f"{layers:>8}{3 * layers**2:>8}{wall:>10.1f}{core:>10.1f}{memory:>8.2f}  {digest}", flush=True
            )
            found.append({"layers": layers, "wall_s": wall, "core_s": core, "gb": memory, "digest": digest})
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
