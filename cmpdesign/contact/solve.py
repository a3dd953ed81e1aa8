"""Press, shear and twist an object into the layer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.errors import ContactError, require
from cmpdesign.contact.friction.increment import (
    ContactProblem,
    ContactState,
    solve_increment,
    state_without_contact,
)
from cmpdesign.contact.grid import make_contact_grid
from cmpdesign.contact.make_result import contact_from_state
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects.indenters import Indenter
from cmpdesign.contact.result import Contact


def solve(
    elastomer: Elastomer,
    indenter: Indenter,
    motion: Motion,
    *,
    friction: float = 0.5,
    size_mm: tuple[float, float] = (30.0, 30.0),
    grid: int = 256,
    steps: int = 4,
) -> Contact:
    """Press, then shear and twist, each in ``steps`` equal increments.

    Args:
        elastomer: the layer; it goes on beyond ``size_mm``.
        indenter: the object.
        motion: where it ends up.
        friction: Coulomb's coefficient; 0 slides freely, ``math.inf`` sticks wherever it presses.
        size_mm: width and height of the solved area, centred on the layout frame's origin.
        grid: cells along its longer side.
        steps: increments of the press (one without friction), and again of shear and twist.

    Raises:
        ContactError: a value out of range, or an object that misses the solved area.
    """
    require(isinstance(steps, int) and 1 <= steps <= 1000, "steps", steps, "a whole number from 1 to 1000")
    presses = 1 if friction == 0 or motion.press_mm == 0 else steps
    way = [motion.part(i / presses, 0.0) for i in range(1, presses + 1)]
    if motion.tangential:
        tangential = 1 if friction == 0 or motion.press_mm == 0 else steps
        way += [motion.part(1.0, i / tangential) for i in range(1, tangential + 1)]
    problem = _make_problem(elastomer, indenter, friction, size_mm, grid)
    *_, last = _solve_states(problem, way)
    return contact_from_state(problem, last, elastomer.young_mpa)


def solve_path(
    elastomer: Elastomer,
    indenter: Indenter,
    motions: Sequence[Motion],
    *,
    friction: float = 0.5,
    size_mm: tuple[float, float] = (30.0, 30.0),
    grid: int = 256,
) -> Iterator[Contact]:
    """One contact for each of the motions, each reached from the one before in one increment.

    Any way will do: deeper and back, to and fro; what sticks and slips depends on it. Other arguments as in ``solve``.
    """
    problem = _make_problem(elastomer, indenter, friction, size_mm, grid)
    for state in _solve_states(problem, motions):
        yield contact_from_state(problem, state, elastomer.young_mpa)


def _make_problem(
    elastomer: Elastomer, indenter: Indenter, friction: float, size_mm: tuple[float, float], grid: int
) -> ContactProblem:
    require(friction >= 0, "friction", friction, "0 or more (math.inf sticks)")
    # Young's modulus scales forces and nothing else: solved with 1 MPa, whatever it is.
    layer = replace(elastomer, young_mpa=1.0)
    return ContactProblem(layer, indenter, float(friction), make_contact_grid(size_mm, grid))


def _solve_states(problem: ContactProblem, motions: Sequence[Motion]) -> Iterator[ContactState]:
    state = state_without_contact(Motion(0.0), problem.grid.shape)
    if not np.isfinite(problem.indenter.height_mm(*problem.grid.xy_mm)).any():
        x, y = problem.indenter.centre_mm
        raise ContactError(
            f"the object at ({x:g}, {y:g}) mm covers no cell of the solved area; "
            "move centre_mm, or take a larger size_mm or grid"
        )
    for motion in motions:
        state = solve_increment(problem, state, motion)
        yield state
