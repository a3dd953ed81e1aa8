"""Solution of contacts: an object presses, shears and twists on the elastic layer."""

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
    """Solve a press, then shear and twist, each in ``steps`` equal increments.

    Args:
        elastomer: the elastic layer; it extends beyond ``size_mm``.
        indenter: the object.
        motion: the object's motion.
        friction: Coulomb's coefficient; 0: no friction, ``math.inf``: no slip wherever there is pressure.
        size_mm: width and height of the solved area, centred on the layout frame's origin.
        grid: cells along the longer side of the area.
        steps: increments of the press, and again of shear and twist; without friction one each.

    Raises:
        ContactError: a value is out of range, or the object misses the solved area.
    """
    require(isinstance(steps, int) and 1 <= steps <= 1000, "steps", steps, "a whole number from 1 to 1000")
    press_increments = 1 if friction == 0 or motion.press_mm == 0 else steps
    motions = [motion.part(i / press_increments, 0.0) for i in range(1, press_increments + 1)]
    if motion.tangential:
        tangential_increments = 1 if friction == 0 or motion.press_mm == 0 else steps
        motions += [motion.part(1.0, i / tangential_increments) for i in range(1, tangential_increments + 1)]
    problem = _make_problem(elastomer, indenter, friction, size_mm, grid)
    *_, last = _solve_states(problem, motions)
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
    """Solve one contact for each motion, each by one increment from the previous contact.

    Motions may be in any order, for example deeper and back. Stick and slip depend on the order. The other arguments
    are those of ``solve``.
    """
    problem = _make_problem(elastomer, indenter, friction, size_mm, grid)
    for state in _solve_states(problem, motions):
        yield contact_from_state(problem, state, elastomer.young_mpa)


def _make_problem(
    elastomer: Elastomer, indenter: Indenter, friction: float, size_mm: tuple[float, float], grid: int
) -> ContactProblem:
    require(friction >= 0, "friction", friction, "0 or more (math.inf sticks)")
    # Young's modulus only scales forces, so every problem is solved with 1 MPa.
    unit_elastomer = replace(elastomer, young_mpa=1.0)
    return ContactProblem(unit_elastomer, indenter, float(friction), make_contact_grid(size_mm, grid))


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
