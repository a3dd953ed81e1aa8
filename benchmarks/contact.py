"""Contacts on 256 x 256 cells: time, and the error against a finer grid and against closed forms."""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.contact import Ball, Contact, Cube, Elastomer, Indenter, Motion, Punch, Ring, solve
from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.scene import standard_layout

Array = NDArray[np.float64]
LAYER = Elastomer(4.0, 0.3)
SIZE_MM = (30.0, 30.0)
GRID, FINE = 256, 448
LIMIT_S = 1.0


@dataclass(frozen=True)
class Case:
    """One contact."""

    name: str
    indenter: Indenter
    motion: Motion
    friction: float


CASES = (
    Case("ball of 10 mm, press 1", Ball(10.0), Motion(1.0), 0.0),
    Case("ring of 6 mm, tube 1.5, press 1", Ring(6.0, 1.5), Motion(1.0), 0.0),
    Case("cube of 15 mm, press 1", Cube(15.0, 0.5), Motion(1.0), 0.0),
    Case("ball of 10 mm, press 1, friction", Ball(10.0), Motion(1.0), 0.5),
    Case("ball of 10 mm, press 1, shear 1", Ball(10.0), Motion(1.0, (1.0, 0.0)), 0.5),
    Case("ball of 20 mm, press 2, shear 1.5", Ball(20.0), Motion(2.0, (1.5, 0.0)), 0.5),
    Case("ball of 20 mm, press 2, twist 30", Ball(20.0), Motion(2.0, twist_deg=30.0), 0.5),
    Case("cube of 15 mm, press 1, shear 1", Cube(15.0, 0.5), Motion(1.0, (0.0, 1.0)), 0.5),
)


@dataclass(frozen=True)
class ContactFigures:
    """What one case took, and how far its markers are from where a finer grid has them."""

    name: str
    cells_in_contact: int
    applications: int
    cold_s: float
    warm_s: float
    wall_s: float
    rms_um: float
    largest_um: float
    force_percent: float


def timed_contact(case: Case, grid: int) -> tuple[Contact, float, float]:
    """The contact, the processor's seconds and the clock's."""
    started, began = time.process_time(), time.perf_counter()
    found = solve(LAYER, case.indenter, case.motion, friction=case.friction, size_mm=SIZE_MM, grid=grid)
    return found, time.process_time() - started, time.perf_counter() - began


def measure_contact(case: Case, runs: int, markers_mm: Array) -> ContactFigures:
    """Cold is the first contact on a layer and grid, warm the best of some with its kernels at hand."""
    green_kernels.cache_clear()
    found, cold, wall = timed_contact(case, GRID)
    warm = min(timed_contact(case, GRID)[1] for _ in range(runs))
    fine, *_ = timed_contact(case, FINE)
    error = np.linalg.norm(found.surface()(markers_mm) - fine.surface()(markers_mm), axis=1)
    return ContactFigures(
        name=case.name,
        cells_in_contact=int(found.in_contact.sum()),
        applications=found.iterations,
        cold_s=cold,
        warm_s=warm,
        wall_s=wall,
        rms_um=1e3 * float(np.sqrt(np.mean(error**2))),
        largest_um=1e3 * float(error.max()),
        force_percent=100
        * float(np.linalg.norm(found.force_n - fine.force_n) / np.linalg.norm(fine.force_n)),
    )


def closed_form_errors() -> dict[str, float]:
    """Percent off, on layers 1e5 mm thick, contact over the middle third of the grid and more."""
    thick = Elastomer(1e5, 1.0)
    a = math.sqrt(10.0 * 0.01)
    hertz = solve(thick, Ball(10.0), Motion(0.01), friction=0, size_mm=(3 * a, 3 * a), grid=GRID)
    punch = solve(thick, Punch(1.0), Motion(1e-3), friction=0, size_mm=(2.5, 2.5), grid=GRID)
    twist = solve(
        thick, Punch(1.0), Motion(1e-3, twist_deg=0.01), friction=math.inf, size_mm=(2.5, 2.5), grid=GRID
    )
    wanted = {
        "ball (Hertz), force": (-hertz.force_n[2], 16 / 9 * math.sqrt(10.0) * 0.01**1.5),
        "flat punch (Sneddon), force": (-punch.force_n[2], 8 / 3 * 1e-3),
        "stuck punch (Reissner-Sagoci), torque": (twist.moment_nmm[2], 16 / 9 * math.radians(0.01)),
    }
    return {name: 100 * float(found / exact - 1) for name, (found, exact) in wanted.items()}


def contact_table(rows: list[ContactFigures]) -> Table:
    """As it is printed."""
    title = (
        f"Contact, {GRID} x {GRID} cells, {SIZE_MM[0]:g} x {SIZE_MM[1]:g} mm, layer of 4 mm, incompressible"
    )
    drawn = Table(
        title=title,
        caption=f"one core, CPU seconds; markers against {FINE} x {FINE} cells; friction 0.5, 4 steps a motion",
    )
    drawn.add_column("contact")
    for name in ("cells", "answers", "cold s", "warm s", "clock s", "RMS um", "max um", "force %"):
        drawn.add_column(name, justify="right")
    for row in rows:
        drawn.add_row(
            row.name,
            f"{row.cells_in_contact}",
            f"{row.applications}",
            f"{row.cold_s:.2f}",
            f"{row.warm_s:.2f}",
            f"{row.wall_s:.2f}",
            f"{row.rms_um:.1f}",
            f"{row.largest_um:.1f}",
            f"{row.force_percent:.2f}",
        )
    return drawn


def main(arguments: list[str] | None = None) -> int:
    """Run, print, write the JSON file if asked; fails if a contact is too slow."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.contact", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="once each")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results too")
    options = parser.parse_args(arguments)
    markers = standard_layout("honeycomb", 8).marker_xy_mm * 1.5
    solve(LAYER, Ball(5.0), Motion(0.1), grid=32)  # loads what is loaded on first use
    rows = [measure_contact(case, 1 if options.quick else 3, markers) for case in CASES]
    console = Console() if Console().is_terminal else Console(width=110)
    console.print(contact_table(rows))
    forms = closed_form_errors()
    for name, percent in forms.items():
        console.print(f"{name}: {percent:+.2f} %")
    console.print(conditions_text(), style="dim", soft_wrap=True)
    if options.json:
        write_json(options.json, {"contacts": [asdict(row) for row in rows], "closed_forms_percent": forms})
    slow = [row.name for row in rows if row.cold_s > LIMIT_S]
    if slow:
        print(f"above {LIMIT_S:g} s of CPU time: {', '.join(slow)}", file=sys.stderr)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
