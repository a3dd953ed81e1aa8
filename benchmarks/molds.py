"""Molds: time of each step over the number of bosses, the boolean way beside it, and whole processes.

    python benchmarks/molds.py            plates, booleans, a pad of 22 layers
    python benchmarks/molds.py --large    and one of 44

Times are of one core (user and system time), so that a busy machine does not blur them; whole processes show
wall time too. A large mold is made by two processes: its core seconds are of both, its memory of the larger one.
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
from typing import Any

import numpy as np

from cmpdesign import build_layout, load_design
from cmpdesign.layout import RED
from cmpdesign.mold.measure import measure
from cmpdesign.mold.parts import parts_of
from cmpdesign.mold.shells import Feature, Slab, slab_solid, slab_volume_mm3
from cmpdesign.mold.stack import stack_of
from cmpdesign.writers.step import Solid, read_step, solid_to_step

LAYERS = (10, 20, 39, 60)
STEPS = ("describe", "build", "check", "write", "read")
BOOLEAN_LAYERS = 39
EXPONENT_LIMIT = 1.15


def timed(step: Callable[[], Any]) -> tuple[float, Any]:
    start = time.process_time()
    result = step()
    return time.process_time() - start, result


def red_plate(layers: int) -> Slab:
    design = load_design("honeycomb", {"layers": str(layers)})
    parts = parts_of(stack_of(design, build_layout(design)))
    slab = next(part.slab for part in parts if part.color_number == RED)
    assert slab is not None
    return slab


def direct(layers: int) -> tuple[int, list[float], float]:
    """Bosses, seconds of each step, and how far the volume read back is off its closed form."""
    times = []

    def lap(step: Callable[[], Any]) -> Any:
        seconds, result = timed(step)
        times.append(seconds)
        return result

    slab = lap(lambda: red_plate(layers))
    solid = lap(lambda: slab_solid(slab))
    found = lap(lambda: measure(solid))
    data = lap(lambda: solid_to_step(Solid("plate", "#c8322d", solid)))
    again = lap(lambda: read_step(data))
    back = measure(again)
    assert found.valid and found.closed and back.valid and back.closed
    return len(slab.many), times, abs(back.volume_mm3 / slab_volume_mm3(slab) - 1)


def boolean(layers: int) -> list[float]:
    """The same plate by one general fuse of a plain slab and all bosses, sunk a little into it."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.collections import List_TopoDS_Shape

    slab = red_plate(layers)

    def build() -> Any:
        plain = Slab(slab.outer, slab.bottom_mm, slab.top_mm, slab.through)
        arguments, tools = List_TopoDS_Shape(), List_TopoDS_Shape()
        arguments.Append(slab_solid(plain))
        for boss in slab.many:
            tools.Append(standing(boss))
        fuse = BRepAlgoAPI_Fuse()
        fuse.SetArguments(arguments)
        fuse.SetTools(tools)
        fuse.Build()
        return fuse.Shape()

    seconds, shape = timed(build)
    checked, _ = timed(lambda: measure(shape))
    written, data = timed(lambda: solid_to_step(Solid("plate", "#c8322d", shape)))
    read, _ = timed(lambda: read_step(data))
    return [seconds, checked, written, read]


def standing(boss: Feature) -> Any:
    """A boss as a solid of its own, reaching 0.1 mm below the plate's face."""
    return slab_solid(Slab(boss.root, -0.1, boss.height_mm, outer_top=boss.tip))


def process(layers: int, folder: Path) -> tuple[float, float, float, str]:
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


def plates() -> None:
    slab_solid(red_plate(2))  # the kernel's libraries are loaded before the clock runs
    print("Boss plates, seconds of one core")
    print(f"{'bosses':>8}" + "".join(f"{step:>10}" for step in STEPS) + f"{'volume off by':>16}")
    counts, table = [], []
    for layers in LAYERS:
        bosses, times, error = direct(layers)
        counts.append(bosses)
        table.append(times)
        print(f"{bosses:>8}" + "".join(f"{t:>10.3f}" for t in times) + f"{error:>16.1e}", flush=True)
    slopes = [float(np.polyfit(np.log(counts), np.log(column), 1)[0]) for column in np.array(table).T]
    print(f"{'exponent':>8}" + "".join(f"{slope:>10.2f}" for slope in slopes) + f"   limit {EXPONENT_LIMIT}")
    ours = table[LAYERS.index(BOOLEAN_LAYERS)][1:]
    other = boolean(BOOLEAN_LAYERS)
    print(f"\nBooleans, {BOOLEAN_LAYERS**2} bosses" + " " * 3 + "".join(f"{step:>10}" for step in STEPS[1:]))
    print(f"{'boolean':>24}" + "".join(f"{t:>10.3f}" for t in other))
    print(f"{'direct':>24}" + "".join(f"{t:>10.3f}" for t in ours))
    print(f"{'ratio':>24}" + "".join(f"{b / a:>10.1f}" for a, b in zip(ours, other, strict=True)), flush=True)


def processes(large: bool) -> None:
    print("\nWhole processes: cmpdesign build honeycomb --only mold")
    print(f"{'layers':>8}{'cells':>8}{'wall s':>10}{'core s':>10}{'GB':>8}  digest of the files")
    with tempfile.TemporaryDirectory() as folder:
        for layers in (22, 22, 44) if large else (22, 22):
            wall, core, memory, digest = process(layers, Path(folder))
            print(
                f"{layers:>8}{3 * layers**2:>8}{wall:>10.1f}{core:>10.1f}{memory:>8.2f}  {digest}", flush=True
            )


if __name__ == "__main__":
    plates()
    processes("--large" in sys.argv)
