"""One increment of a contact with Coulomb friction.

Normal and tangential tractions are coupled (C_xz), so every increment is solved for all three components at once.
Within one increment a cell in contact sticks to its previous point of the object, or slips against friction. A cell
that comes into contact sticks at its current position.

The theory is linear: the object's height over a point of the surface is evaluated at the point's position before the
press. Only the distance that the point has slid over the object is added, so that a sliding contact advances.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.contact.elastic_layer.operator import ComplianceOperator, interior_displacement_mm
from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.friction.admissible import CoulombTractions, PressureTractions
from cmpdesign.contact.friction.quadratic_program import minimise
from cmpdesign.contact.grid import ContactGrid
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects.indenters import Indenter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# The tolerated gap over the press: a tenth of a micrometre at 1 mm.
GAP_TOLERANCE = 1e-4
# With friction: three tenths of a micrometre, because the limits are unknown too.
GAP_TOLERANCE_FRICTION = 3e-4
# Before the object's height is evaluated again, and of the pressure that initialises a solution with friction.
GAP_TOLERANCE_PREDICTOR, GAP_TOLERANCE_START = 3e-3, 1e-2
# The tolerated relative change of the friction limits, over the gap's tolerance.
LIMIT_CHANGE_TOLERANCE = 1.7
# Cells around the cells that may come into contact.
BOX_MARGIN_CELLS = 3


class CellBox(NamedTuple):
    """A box of the grid's cells, as an index of (ny, nx) arrays."""

    rows: slice
    columns: slice


class BoxSolution(NamedTuple):
    """Tractions of one solution in a box of cells.

    Attributes:
        traction_mpa: (3, ny, nx) float64, 0 outside the box.
        limit_mpa: the friction limit in the box, (rows, columns); without friction (1, rows, columns) zeros.
        operator_applications: how often the elastic layer's response was computed.
        residual_gap_mm: RMS of the remaining gap.
    """

    traction_mpa: Array
    limit_mpa: Array
    operator_applications: int
    residual_gap_mm: float


@dataclass(frozen=True, eq=False)
class ContactState:
    """The surface after some motion.

    Attributes:
        motion: the object's motion from its first touch.
        traction_mpa, displacement_mm: (3, ny, nx) float64.
        press_displacement_mm: (2, ny, nx) lateral displacement by the press alone.
        press_traction_mpa: (3, ny, nx) the tractions that make it.
        limit_mpa: (ny, nx) the friction limit.
        iterations: how often the elastic layer's response was computed.
        residual_mm: RMS of the remaining gap.
    """

    motion: Motion
    traction_mpa: Array
    displacement_mm: Array
    press_displacement_mm: Array
    press_traction_mpa: Array
    limit_mpa: Array
    iterations: int = 0
    residual_mm: float = 0.0

    @property
    def in_contact(self) -> Mask:
        """(ny, nx) bool."""
        return np.asarray(self.traction_mpa[2] < 0)


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """The constants of all increments.

    Attributes:
        elastomer: the elastic layer, with a Young's modulus of 1 MPa.
        indenter: the object.
        friction: Coulomb's coefficient.
        grid: the cells.
        operators: the response operators by the shape of their box.
    """

    elastomer: Elastomer
    indenter: Indenter
    friction: float
    grid: ContactGrid
    operators: dict[tuple[int, int], ComplianceOperator] = field(default_factory=dict, repr=False)

    def height_mm(self, xy_mm: Array) -> Array:
        """(ny, nx) height of the object in its initial pose over points (2, ny, nx)."""
        return self.indenter.height_mm(*xy_mm)

    def operator(self, box: CellBox) -> ComplianceOperator:
        """The elastic layer's response on a box of cells; made once for each shape of box."""
        shape = (box.rows.stop - box.rows.start, box.columns.stop - box.columns.start)
        if shape not in self.operators:
            kernels = green_kernels(self.elastomer, self.grid.step_mm, max(self.grid.shape))
            self.operators[shape] = ComplianceOperator(kernels, shape)
        return self.operators[shape]

    def surface_displacement_mm(self, traction_mpa: Array) -> Array:
        """Displacement (3, ny, nx) of all cells, in single precision: its error is a millionth of the solver's gap."""
        rows, columns = self.grid.shape
        whole = self.operator(CellBox(slice(0, rows), slice(0, columns)))
        return whole(traction_mpa.astype(np.float32)).astype(np.float64)

    def interior_displacement_mm(self, traction_mpa: Array) -> Array:
        """Displacement (3, ny, nx) at the pattern's depth, for a depth above 0."""
        depth_mm = self.elastomer.marker_depth_mm
        kernels = green_kernels(self.elastomer, self.grid.step_mm, max(self.grid.shape), depth_mm)
        return interior_displacement_mm(kernels, traction_mpa)


def state_without_contact(motion: Motion, shape: tuple[int, int]) -> ContactState:
    """The state of the flat surface; ``shape`` is the grid's (ny, nx)."""
    zeros = np.zeros((3, *shape))
    return ContactState(motion, zeros, zeros, zeros[:2], zeros, zeros[0])


def solve_increment(problem: ContactProblem, state: ContactState, motion: Motion) -> ContactState:
    """The state after one more increment.

    The box starts with the cells that may come into contact. It grows while other cells would penetrate the object.
    """
    if motion.press_mm == 0:
        return state_without_contact(motion, problem.grid.shape)
    height = problem.height_mm(_points_in_object_frame(problem, state, motion))
    candidates = height < 1.15 * motion.press_mm
    if not candidates.any():
        return state_without_contact(motion, problem.grid.shape)
    candidates |= state.in_contact
    start_mpa = state.traction_mpa
    while True:
        box = _box_around(candidates, problem.grid.shape)
        solved, height = _solve_in_box(problem, state, motion, box, start_mpa)
        penetrating = (
            solved.displacement_mm[2] > height - motion.press_mm + 10 * GAP_TOLERANCE * motion.press_mm
        )
        penetrating[box] = False
        if not penetrating.any():
            return solved
        candidates |= penetrating
        start_mpa, state = solved.traction_mpa, replace(state, iterations=solved.iterations)


def _box_around(cells: Mask, shape: tuple[int, int]) -> CellBox:
    """The bounding box of some cells, with a margin for the growth of the contact."""
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    return CellBox(
        slice(max(int(rows[0]) - BOX_MARGIN_CELLS, 0), min(int(rows[-1]) + 1 + BOX_MARGIN_CELLS, shape[0])),
        slice(
            max(int(columns[0]) - BOX_MARGIN_CELLS, 0), min(int(columns[-1]) + 1 + BOX_MARGIN_CELLS, shape[1])
        ),
    )


def _points_in_object_frame(problem: ContactProblem, state: ContactState, motion: Motion) -> Array:
    """(2, ny, nx) positions of all points in the object's initial frame if they move with the object."""
    if problem.friction == 0:
        return motion.brought_back(problem.grid.xy_mm, problem.indenter.centre_mm)
    position = problem.grid.xy_mm + state.displacement_mm[:2] - state.press_displacement_mm
    return state.motion.brought_back(position, problem.indenter.centre_mm)


def _solve_in_box(
    problem: ContactProblem, state: ContactState, motion: Motion, box: CellBox, start_mpa: Array
) -> tuple[ContactState, Array]:
    """The state with tractions in a box of cells, and the object's height (ny, nx) over all cells."""
    grid, centre = problem.grid, problem.indenter.centre_mm
    height = problem.height_mm(_points_in_object_frame(problem, state, motion))
    solution = _solve_pressure(problem, start_mpa, height, motion, box)
    applications = solution.operator_applications
    limit = np.zeros(grid.shape)
    is_press = motion.part(0, 1) == state.motion.part(0, 1)
    if problem.friction > 0:
        sticking = _sticking_displacement(grid, state, motion, centre)
        # The height over a point changes where the object slides. It is evaluated again with the predicted slip.
        if not is_press:
            solution = _solve_friction(
                problem, solution.traction_mpa, height, sticking, motion, box, GAP_TOLERANCE_PREDICTOR
            )
            applications += solution.operator_applications
            predicted = problem.surface_displacement_mm(solution.traction_mpa)
            moved = grid.xy_mm + predicted[:2] - state.press_displacement_mm
            height = problem.height_mm(motion.brought_back(moved, centre))
            solution = _solve_pressure(problem, solution.traction_mpa, height, motion, box)
            applications += solution.operator_applications
        solution = _solve_friction(
            problem, solution.traction_mpa, height, sticking, motion, box, GAP_TOLERANCE_FRICTION
        )
        limit[box] = solution.limit_mpa
        applications += solution.operator_applications
    displacement = problem.surface_displacement_mm(solution.traction_mpa)
    by_press, press_traction = state.press_displacement_mm, state.press_traction_mpa
    if is_press:
        by_press = by_press + (displacement - state.displacement_mm)[:2]
        press_traction = press_traction + (solution.traction_mpa - state.traction_mpa)
    solved = ContactState(
        motion,
        solution.traction_mpa,
        displacement,
        by_press,
        press_traction,
        limit,
        state.iterations + applications,
        solution.residual_gap_mm,
    )
    return solved, height


def _sticking_displacement(
    grid: ContactGrid, state: ContactState, motion: Motion, centre_mm: tuple[float, float]
) -> Array:
    """Displacement (2, ny, nx) of points that do not slip: with the object, or unchanged before contact."""
    position = grid.xy_mm + state.displacement_mm[:2]
    carried = motion.carried(state.motion.brought_back(position, centre_mm), centre_mm)
    return np.where(state.in_contact, carried, position) - grid.xy_mm


def _solve_pressure(
    problem: ContactProblem, traction: Array, height: Array, motion: Motion, box: CellBox
) -> BoxSolution:
    """Tractions whose pressure leaves no gap, at constant shear. With friction the result is only initial."""
    operator, inside = problem.operator(box), (..., *box)
    shear = traction[inside].copy()
    start, shear[2] = shear[2].copy(), 0.0
    offset = operator(shear.astype(np.float32))[2] if shear.any() else 0.0
    contact_candidates = np.isfinite(height[box])
    target = np.where(contact_candidates, height[box], 0.0) - motion.press_mm - offset
    z = minimise(
        operator,
        target[None],
        PressureTractions(contact_candidates[None]),
        start[None],
        tolerance_mm=(GAP_TOLERANCE_START if problem.friction > 0 else GAP_TOLERANCE) * motion.press_mm,
        verify=problem.friction == 0,
    )
    solved = np.zeros_like(traction)
    solved[inside] = shear
    solved[(2, *box)] = z.traction_mpa[0]
    return BoxSolution(solved, z.admissible.limit_mpa, z.operator_applications, z.residual_gap_mm)


def _solve_friction(
    problem: ContactProblem,
    traction: Array,
    height: Array,
    sticking: Array,
    motion: Motion,
    box: CellBox,
    tolerance: float,
) -> BoxSolution:
    """Tractions with shear up to the friction coefficient times the pressure.

    Args:
        problem: the constants.
        traction: (3, ny, nx) MPa, the initial tractions.
        height: (ny, nx) mm of the object over the surface.
        sticking: (2, ny, nx) mm displacement without slip.
        motion: the object's motion after this increment.
        box: the cells to solve.
        tolerance: of the gap, over the press.
    """
    operator, inside = problem.operator(box), (..., *box)
    contact_candidates = np.isfinite(height[box])
    target = np.concatenate(
        [sticking[inside], (np.where(contact_candidates, height[box], 0.0) - motion.press_mm)[None]]
    )
    t = minimise(
        operator,
        target,
        CoulombTractions.at(contact_candidates, problem.friction, traction[(2, *box)]),
        traction[inside],
        tolerance_mm=tolerance * motion.press_mm,
        limit_tolerance=LIMIT_CHANGE_TOLERANCE * tolerance,
        verify=tolerance <= GAP_TOLERANCE_FRICTION,
    )
    solved = np.zeros_like(traction)
    solved[inside] = t.traction_mpa
    return BoxSolution(solved, t.admissible.limit_mpa, t.operator_applications, t.residual_gap_mm)
