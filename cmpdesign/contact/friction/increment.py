"""One increment of a contact with Coulomb friction.

Normal and tangential tractions act on each other (C_xz), so every increment is solved for all three at once. Within one
increment a cell in contact sticks to the place of the object that it touched before, or slips against its friction. A
cell that comes into contact sticks where it is.

The theory is linear: the object's height over a point of the surface is read at the point's place before the press.
Only how far it has slid over the object since is followed, so that a sliding contact moves on.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.friction.allowed import Friction, Pressure
from cmpdesign.contact.friction.quadratic import minimise
from cmpdesign.contact.grid import Grid
from cmpdesign.contact.layer.green import green
from cmpdesign.contact.layer.operator import Operator
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects.objects import Indenter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Box = tuple[slice, slice]
# The gap that may be left, over the press: a tenth of a micrometre at 1 mm.
TOLERANCE = 1e-4
# With friction, whose limits have to be found as well, three tenths; more where that is but a start, or where the
# height is looked up again after.
TOLERANCE_RUBBING = 3e-4
TOLERANCE_BEFORE, TOLERANCE_START = 3e-3, 1e-2
# The change of friction's limits, as a share of them, over the tolerance.
STEADY = 1.7
# Cells around what is near enough to touch.
MARGIN = 3


@dataclass(frozen=True, eq=False)
class State:
    """The surface (3, ny, nx) after some motion.

    ``settled_mm`` (2, ny, nx) is what pressing moved sideways, ``limit_mpa`` (ny, nx) how much friction there is.
    """

    motion: Motion
    traction_mpa: Array
    displacement_mm: Array
    settled_mm: Array
    limit_mpa: Array
    iterations: int = 0
    residual_mm: float = 0.0

    @property
    def in_contact(self) -> Mask:
        """(ny, nx) bool."""
        return np.asarray(self.traction_mpa[2] < 0)


@dataclass(frozen=True, eq=False)
class Problem:
    """What stays the same in all increments; the elastomer is one of 1 MPa."""

    elastomer: Elastomer
    indenter: Indenter
    friction: float
    grid: Grid
    operators: dict[tuple[int, int], Operator] = field(default_factory=dict, repr=False)

    def height_mm(self, xy_mm: Array) -> Array:
        """Height of the object, as it first stood, over points (2, ny, nx)."""
        return self.indenter.height_mm(*xy_mm)

    def operator(self, box: Box) -> Operator:
        """The layer's answer on a box of cells; made once for each size of box."""
        rows, columns = box
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        if shape not in self.operators:
            kernels = green(self.elastomer, self.grid.step_mm, max(self.grid.shape))
            self.operators[shape] = Operator(kernels, shape)
        return self.operators[shape]

    def answer_mm(self, traction_mpa: Array) -> Array:
        """Displacement (3, ny, nx) of all cells, in single precision: what errs is a millionth of the solver's gap."""
        rows, columns = self.grid.shape
        whole = self.operator((slice(0, rows), slice(0, columns)))
        return whole(traction_mpa.astype(np.float32)).astype(np.float64)


def untouched(motion: Motion, shape: tuple[int, int]) -> State:
    """The flat surface."""
    nothing = np.zeros((3, *shape))
    return State(motion, nothing, nothing, nothing[:2], nothing[0])


def advance(problem: Problem, state: State, motion: Motion) -> State:
    """The state after one more increment. Starts with the cells that may touch, takes in what else would."""
    if motion.press_mm == 0:
        return untouched(motion, problem.grid.shape)
    height = problem.height_mm(_ridden(problem, state, motion))
    near = height < 1.15 * motion.press_mm
    if not near.any():
        return untouched(motion, problem.grid.shape)
    near |= state.in_contact
    start = state.traction_mpa
    while True:
        box = _box_around(near, problem.grid.shape)
        found, height = _solved(problem, state, motion, box, start)
        through = found.displacement_mm[2] > height - motion.press_mm + 10 * TOLERANCE * motion.press_mm
        through[box] = False
        if not through.any():
            return found
        near |= through
        start, state = found.traction_mpa, replace(state, iterations=found.iterations)


def _box_around(cells: Mask, shape: tuple[int, int]) -> Box:
    """The bounding box of some cells, with a margin in which a contact can grow."""
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    return (
        slice(max(int(rows[0]) - MARGIN, 0), min(int(rows[-1]) + 1 + MARGIN, shape[0])),
        slice(max(int(columns[0]) - MARGIN, 0), min(int(columns[-1]) + 1 + MARGIN, shape[1])),
    )


def _ridden(problem: Problem, state: State, motion: Motion) -> Array:
    """Where in the object's first frame every point is if it rides along (2, ny, nx)."""
    if problem.friction == 0:
        return motion.brought_back(problem.grid.xy_mm, problem.indenter.centre_mm)
    moved = problem.grid.xy_mm + state.displacement_mm[:2] - state.settled_mm
    return state.motion.brought_back(moved, problem.indenter.centre_mm)


def _solved(
    problem: Problem, state: State, motion: Motion, box: Box, start_mpa: Array
) -> tuple[State, Array]:
    """The state with tractions in a box of cells, and the object's height over all cells."""
    grid, centre = problem.grid, problem.indenter.centre_mm
    height = problem.height_mm(_ridden(problem, state, motion))
    traction, applied, left = _pressed(problem, start_mpa, height, motion, box)
    limit = np.zeros(grid.shape)
    pressing = motion.part(0, 1) == state.motion.part(0, 1)
    if problem.friction > 0:
        wanted = _wanted(grid, state, motion, centre)
        # Where the object slides its height over a point changes; it is looked up again with what has slid so far.
        if not pressing:
            traction, _, more, _ = _rubbed(problem, traction, height, wanted, motion, box, TOLERANCE_BEFORE)
            applied += more
            moved = grid.xy_mm + problem.answer_mm(traction)[:2] - state.settled_mm
            height = problem.height_mm(motion.brought_back(moved, centre))
            traction, more, _ = _pressed(problem, traction, height, motion, box)
            applied += more
        traction, limit[box], more, left = _rubbed(
            problem, traction, height, wanted, motion, box, TOLERANCE_RUBBING
        )
        applied += more
    displacement = problem.answer_mm(traction)
    settled = state.settled_mm + (displacement - state.displacement_mm)[:2] if pressing else state.settled_mm
    found = State(motion, traction, displacement, settled, limit, state.iterations + applied, left)
    return found, height


def _wanted(grid: Grid, state: State, motion: Motion, centre_mm: tuple[float, float]) -> Array:
    """Displacement (2, ny, nx) of points that do not slip: on with the object, or where they were before it came."""
    place = grid.xy_mm + state.displacement_mm[:2]
    carried = motion.carried(state.motion.brought_back(place, centre_mm), centre_mm)
    return np.where(state.in_contact, carried, place) - grid.xy_mm


def _pressed(
    problem: Problem, traction: Array, height: Array, motion: Motion, box: Box
) -> tuple[Array, int, float]:
    """Tractions whose pressure leaves no gap, friction held as it is; with friction, this is but a start."""
    operator, inside = problem.operator(box), (..., *box)
    held = traction[inside].copy()
    start, held[2] = held[2].copy(), 0.0
    offset = operator(held.astype(np.float32))[2] if held.any() else 0.0
    touchable = np.isfinite(height[box])
    target = np.where(touchable, height[box], 0.0) - motion.press_mm - offset
    z = minimise(
        operator,
        target[None],
        Pressure(touchable[None]),
        start[None],
        tolerance_mm=(TOLERANCE_START if problem.friction > 0 else TOLERANCE) * motion.press_mm,
        checked=problem.friction == 0,
    )
    found = np.zeros_like(traction)
    found[inside] = held
    found[(2, *box)] = z.traction_mpa[0]
    return found, z.applied, z.left_mm


def _rubbed(
    problem: Problem,
    traction: Array,
    height: Array,
    wanted: Array,
    motion: Motion,
    box: Box,
    tolerance: float,
) -> tuple[Array, Array, int, float]:
    """Tractions with friction up to the friction coefficient times the pressure, and that limit in the box."""
    operator, inside = problem.operator(box), (..., *box)
    touchable = np.isfinite(height[box])
    target = np.concatenate([wanted[inside], (np.where(touchable, height[box], 0.0) - motion.press_mm)[None]])
    t = minimise(
        operator,
        target,
        Friction.at(touchable, problem.friction, traction[(2, *box)]),
        traction[inside],
        tolerance_mm=tolerance * motion.press_mm,
        steady=STEADY * tolerance,
        checked=tolerance <= TOLERANCE_RUBBING,
    )
    found = np.zeros_like(traction)
    found[inside] = t.traction_mpa
    return found, t.allowed.limit_mpa, t.applied, t.left_mm
