"""Contacts on 256 x 256 cells: time, and the error against a finer grid and against closed forms.

Times are processor seconds of one core. "cold" is the first contact on an elastic layer and grid, "warm" the best of
some with its kernels. "RMS" and "max" are distances of markers from their positions on a grid of 448 x 448 cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.frame.experiment import Experiment, Found, Shown
from benchmarks.frame.pooled import rms_of
from benchmarks.frame.table import TEXT, Table
from benchmarks.frame.timing import Timed, timed
from cmpdesign.contact import Ball, Contact, Cube, Elastomer, Indenter, Motion, Punch, Ring, solve
from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.scene import standard_layout

Array = NDArray[np.float64]
ELASTOMER = Elastomer(4.0, 0.3)
SIZE_MM = (30.0, 30.0)
GRID, FINE = 256, 448
LIMIT_S = 1.0


class Case(NamedTuple):
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
COLUMNS = {
    "contact": TEXT, "cells": "d", "answers": "d", "cold s": ".2f", "warm s": ".2f", "clock s": ".2f",
    "RMS um": ".1f", "max um": ".1f", "force %": ".2f",
}  # fmt: skip


def solve_case(case: Case, grid: int) -> Timed[Contact]:
    """Solve a contact and measure its time."""
    return timed(
        lambda: solve(
            ELASTOMER, case.indenter, case.motion, friction=case.friction, size_mm=SIZE_MM, grid=grid
        )
    )


def contact_row(case: Case, runs: int, markers_mm: Array) -> tuple[object, ...]:
    """The row of ``COLUMNS``."""
    green_kernels.cache_clear()
    cold = solve_case(case, GRID)
    warm_ms = min(solve_case(case, GRID).cpu_ms for _ in range(runs))
    found, fine = cold.result, solve_case(case, FINE).result
    error_um = 1e3 * np.linalg.norm(found.surface()(markers_mm) - fine.surface()(markers_mm), axis=1)
    force = np.linalg.norm(found.force_n - fine.force_n) / np.linalg.norm(fine.force_n)
    return (
        case.name, int(found.in_contact.sum()), found.iterations, cold.cpu_ms / 1e3, warm_ms / 1e3, cold.clock_ms / 1e3,
        rms_of(error_um), float(error_um.max()), 100 * float(force),
    )  # fmt: skip


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


def measure(quick: bool = False) -> Shown:
    """Fails if a contact takes more than a second.

    Args:
        quick: every contact once.
    """
    markers_mm = standard_layout("honeycomb", 8).marker_xy_mm * 1.5
    solve(ELASTOMER, Ball(5.0), Motion(0.1), grid=32)  # loads what is loaded on first use
    rows = [contact_row(case, 1 if quick else 3, markers_mm) for case in CASES]
    size = f"{GRID} x {GRID} cells, {SIZE_MM[0]:g} x {SIZE_MM[1]:g} mm, layer of 4 mm, incompressible"
    yield Table(f"contacts, {size}; friction 0.5, 4 steps a motion", COLUMNS, rows)
    yield Table("closed forms", {"form": TEXT, "error %": "+.2f"}, list(closed_form_errors().items()))
    slow = [row[0] for row in rows if row[3] > LIMIT_S]
    if slow:
        yield f"above {LIMIT_S:g} s of CPU time: {', '.join(slow)}"
    return Found(failed=bool(slow))


main = Experiment("contact", measure)
main.run_as(__name__)
