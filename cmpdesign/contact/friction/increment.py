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

from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.contact.elastic_layer.operator import ComplianceOperator
from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.friction.admissible import CoulombTractions, PressureTractions
from cmpdesign.contact.friction.quadratic_program import minimise
from cmpdesign.contact.grid import ContactGrid
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects.indenters import Indenter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
CellBox = tuple[slice, slice]
# The gap that may be left, over the press: a tenth of a micrometre at 1 mm.
GAP_TOLERANCE = 1e-4
# With friction, whose limits have to be found as well, three tenths; more where that is but a start, or where the
# height is looked up again after.
GAP_TOLERANCE_FRICTION = 3e-4
GAP_TOLERANCE_PREDICTOR, GAP_TOLERANCE_START = 3e-3, 1e-2
# The change of friction's limits, as a share of them, over the tolerance.
LIMIT_CHANGE_TOLERANCE = 1.7
# Cells around what is near enough to touch.
BOX_MARGIN_CELLS = 3


@dataclass(frozen=True, eq=False)
class ContactState:
    """The surface (3, ny, nx) after some motion.

    ``press_displacement_mm`` (2, ny, nx) is what pressing moved sideways, ``limit_mpa`` (ny, nx) how much friction
    there is.
    """

    motion: Motion
    traction_mpa: Array
    displacement_mm: Array
    press_displacement_mm: Array
    limit_mpa: Array
    iterations: int = 0
    residual_mm: float = 0.0

    @property
    def in_contact(self) -> Mask:
        """(ny, nx) bool."""
        return np.asarray(self.traction_mpa[2] < 0)


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """What stays the same in all increments; the elastomer is one of 1 MPa."""

    elastomer: Elastomer
    indenter: Indenter
    friction: float
    grid: ContactGrid
    operators: dict[tuple[int, int], ComplianceOperator] = field(default_factory=dict, repr=False)

    def height_mm(self, xy_mm: Array) -> Array:
        """Height of the object, as it first stood, over points (2, ny, nx)."""
        return self.indenter.height_mm(*xy_mm)

    def operator(self, box: CellBox) -> ComplianceOperator:
        """The layer's answer on a box of cells; made once for each size of box."""
        rows, columns = box
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        if shape not in self.operators:
            kernels = green_kernels(self.elastomer, self.grid.step_mm, max(self.grid.shape))
            self.operators[shape] = ComplianceOperator(kernels, shape)
        return self.operators[shape]

    def surface_displacement_mm(self, traction_mpa: Array) -> Array:
        """Displacement (3, ny, nx) of all cells, in single precision: what errs is a millionth of the solver's gap."""
        rows, columns = self.grid.shape
        whole = self.operator((slice(0, rows), slice(0, columns)))
        return whole(traction_mpa.astype(np.float32)).astype(np.float64)


def state_without_contact(motion: Motion, shape: tuple[int, int]) -> ContactState:
    """The flat surface."""
    nothing = np.zeros((3, *shape))
    return ContactState(motion, nothing, nothing, nothing[:2], nothing[0])


def solve_increment(problem: ContactProblem, state: ContactState, motion: Motion) -> ContactState:
    """The state after one more increment. Starts with the cells that may touch, takes in what else would."""
    if motion.press_mm == 0:
        return state_without_contact(motion, problem.grid.shape)
    height = problem.height_mm(_points_in_object_frame(problem, state, motion))
    near = height < 1.15 * motion.press_mm
    if not near.any():
        return state_without_contact(motion, problem.grid.shape)
    near |= state.in_contact
    start = state.traction_mpa
    while True:
        box = _box_around(near, problem.grid.shape)
        found, height = _solve_in_box(problem, state, motion, box, start)
        through = found.displacement_mm[2] > height - motion.press_mm + 10 * GAP_TOLERANCE * motion.press_mm
        through[box] = False
        if not through.any():
            return found
        near |= through
        start, state = found.traction_mpa, replace(state, iterations=found.iterations)


def _box_around(cells: Mask, shape: tuple[int, int]) -> CellBox:
    """The bounding box of some cells, with a margin in which a contact can grow."""
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    return (
        slice(max(int(rows[0]) - BOX_MARGIN_CELLS, 0), min(int(rows[-1]) + 1 + BOX_MARGIN_CELLS, shape[0])),
        slice(
            max(int(columns[0]) - BOX_MARGIN_CELLS, 0), min(int(columns[-1]) + 1 + BOX_MARGIN_CELLS, shape[1])
        ),
    )


def _points_in_object_frame(problem: ContactProblem, state: ContactState, motion: Motion) -> Array:
    """Where in the object's first frame every point is if it rides along (2, ny, nx)."""
    if problem.friction == 0:
        return motion.brought_back(problem.grid.xy_mm, problem.indenter.centre_mm)
    moved = problem.grid.xy_mm + state.displacement_mm[:2] - state.press_displacement_mm
    return state.motion.brought_back(moved, problem.indenter.centre_mm)


def _solve_in_box(
    problem: ContactProblem, state: ContactState, motion: Motion, box: CellBox, start_mpa: Array
) -> tuple[ContactState, Array]:
    """The state with tractions in a box of cells, and the object's height over all cells."""
    grid, centre = problem.grid, problem.indenter.centre_mm
    height = problem.height_mm(_points_in_object_frame(problem, state, motion))
    traction, applied, left = _solve_pressure(problem, start_mpa, height, motion, box)
    limit = np.zeros(grid.shape)
    pressing = motion.part(0, 1) == state.motion.part(0, 1)
    if problem.friction > 0:
        wanted = _sticking_displacement(grid, state, motion, centre)
        # Where the object slides its height over a point changes; it is looked up again with what has slid so far.
        if not pressing:
            traction, _, more, _ = _solve_friction(
                problem, traction, height, wanted, motion, box, GAP_TOLERANCE_PREDICTOR
            )
            applied += more
            moved = grid.xy_mm + problem.surface_displacement_mm(traction)[:2] - state.press_displacement_mm
            height = problem.height_mm(motion.brought_back(moved, centre))
            traction, more, _ = _solve_pressure(problem, traction, height, motion, box)
            applied += more
        traction, limit[box], more, left = _solve_friction(
            problem, traction, height, wanted, motion, box, GAP_TOLERANCE_FRICTION
        )
        applied += more
    displacement = problem.surface_displacement_mm(traction)
    settled = (
        state.press_displacement_mm + (displacement - state.displacement_mm)[:2]
        if pressing
        else state.press_displacement_mm
    )
    found = ContactState(motion, traction, displacement, settled, limit, state.iterations + applied, left)
    return found, height


def _sticking_displacement(
    grid: ContactGrid, state: ContactState, motion: Motion, centre_mm: tuple[float, float]
) -> Array:
    """Displacement (2, ny, nx) of points that do not slip: on with the object, or where they were before it came."""
    place = grid.xy_mm + state.displacement_mm[:2]
    carried = motion.carried(state.motion.brought_back(place, centre_mm), centre_mm)
    return np.where(state.in_contact, carried, place) - grid.xy_mm


def _solve_pressure(
    problem: ContactProblem, traction: Array, height: Array, motion: Motion, box: CellBox
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
        PressureTractions(touchable[None]),
        start[None],
        tolerance_mm=(GAP_TOLERANCE_START if problem.friction > 0 else GAP_TOLERANCE) * motion.press_mm,
        checked=problem.friction == 0,
    )
    found = np.zeros_like(traction)
    found[inside] = held
    found[(2, *box)] = z.traction_mpa[0]
    return found, z.operator_applications, z.residual_gap_mm


def _solve_friction(
    problem: ContactProblem,
    traction: Array,
    height: Array,
    wanted: Array,
    motion: Motion,
    box: CellBox,
    tolerance: float,
) -> tuple[Array, Array, int, float]:
    """Tractions with friction up to the friction coefficient times the pressure, and that limit in the box."""
    operator, inside = problem.operator(box), (..., *box)
    touchable = np.isfinite(height[box])
    target = np.concatenate([wanted[inside], (np.where(touchable, height[box], 0.0) - motion.press_mm)[None]])
    t = minimise(
        operator,
        target,
        CoulombTractions.at(touchable, problem.friction, traction[(2, *box)]),
        traction[inside],
        tolerance_mm=tolerance * motion.press_mm,
        steady=LIMIT_CHANGE_TOLERANCE * tolerance,
        checked=tolerance <= GAP_TOLERANCE_FRICTION,
    )
    found = np.zeros_like(traction)
    found[inside] = t.traction_mpa
    return found, t.allowed.limit_mpa, t.operator_applications, t.residual_gap_mm
