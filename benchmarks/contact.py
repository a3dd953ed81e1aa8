"""Contacts on 256 x 256 cells: time, and the error against a finer grid and against closed forms."""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from benchmarks.support.command import wide_console
from benchmarks.support.machine import conditions_text, write_json
from cmpdesign.contact import Ball, Contact, Cube, Elastomer, Indenter, Motion, Punch, Ring, solve
from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.scene import standard_layout

Array = NDArray[np.float64]
ELASTOMER = Elastomer(4.0, 0.3)
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
    """Time and error of one case: markers' distances from their positions on a finer grid."""

    name: str
    cells_in_contact: int
    applications: int
    cold_s: float
    warm_s: float
    wall_s: float
    rms_um: float
    largest_um: float
    force_percent: float


class TimedContact(NamedTuple):
    """A contact with its processor time and wall time in s."""

    contact: Contact
    cpu_s: float
    wall_s: float


def timed_contact(case: Case, grid: int) -> TimedContact:
    """Solve a contact and measure its time."""
    started, began = time.process_time(), time.perf_counter()
    found = solve(ELASTOMER, case.indenter, case.motion, friction=case.friction, size_mm=SIZE_MM, grid=grid)
    return TimedContact(found, time.process_time() - started, time.perf_counter() - began)


def measure_contact(case: Case, runs: int, markers_mm: Array) -> ContactFigures:
    """Measure a case. Cold: the first contact on an elastic layer and grid; warm: the best of some with its kernels."""
    green_kernels.cache_clear()
    cold = timed_contact(case, GRID)
    warm_s = min(timed_contact(case, GRID).cpu_s for _ in range(runs))
    found, fine = cold.contact, timed_contact(case, FINE).contact
    error = np.linalg.norm(found.surface()(markers_mm) - fine.surface()(markers_mm), axis=1)
    return ContactFigures(
        name=case.name,
        cells_in_contact=int(found.in_contact.sum()),
        applications=found.iterations,
        cold_s=cold.cpu_s,
        warm_s=warm_s,
        wall_s=cold.wall_s,
        rms_um=1e3 * float(np.sqrt(np.mean(error**2))),
        largest_um=1e3 * float(error.max()),
        force_percent=100
        * float(np.linalg.norm(found.force_n - fine.force_n) / np.linalg.norm(fine.force_n)),
    )


def closed_form_errors() -> dict[str, float]:
    """Errors in percent against closed forms, on elastic layers 1e5 mm thick; the contact spans a third of the grid."""
    thick = Elastomer(1e5, 1.0)
    a = math.sqrt(10.0 * 0.01)
    hertz = solve(thick, Ball(10.0), Motion(0.01), friction=0, size_mm=(3 * a, 3 * a), grid=GRID)
    punch = solve(thick, Punch(1.0), Motion(1e-3), friction=0, size_mm=(2.5, 2.5), grid=GRID)
    twist = solve(
        thick, Punch(1.0), Motion(1e-3, twist_deg=0.01), friction=math.inf, size_mm=(2.5, 2.5), grid=GRID
    )
    pairs = {
        "ball (Hertz), force": (-hertz.force_n[2], 16 / 9 * math.sqrt(10.0) * 0.01**1.5),
        "flat punch (Sneddon), force": (-punch.force_n[2], 8 / 3 * 1e-3),
        "stuck punch (Reissner-Sagoci), torque": (twist.moment_nmm[2], 16 / 9 * math.radians(0.01)),
    }
    return {name: 100 * float(found / exact - 1) for name, (found, exact) in pairs.items()}


def contact_table(rows: list[ContactFigures]) -> Table:
    """The table of the terminal."""
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
    solve(ELASTOMER, Ball(5.0), Motion(0.1), grid=32)  # loads what is loaded on first use
    rows = [measure_contact(case, 1 if options.quick else 3, markers) for case in CASES]
    console = wide_console(110)
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
