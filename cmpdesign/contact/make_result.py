"""The public result of a solved state, with its warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.friction.increment import (
    GAP_TOLERANCE,
    GAP_TOLERANCE_FRICTION,
    ContactProblem,
    ContactState,
)
from cmpdesign.contact.result import Contact
from cmpdesign.contact.strain import LINEAR_STRAIN_LIMIT, largest_strain

Array = NDArray[np.float64]
# The smallest number of cells in contact without a warning.
MIN_CONTACT_CELLS = 12


def contact_from_state(problem: ContactProblem, state: ContactState, young_mpa: float) -> Contact:
    """The contact of a state, with forces, strain and warnings; fields become (ny, nx, 3).

    The state is of an elastic layer of 1 MPa; tractions and forces are scaled to ``young_mpa``.
    """
    grid, traction, displacement = problem.grid, state.traction_mpa, state.displacement_mm
    strain = largest_strain(problem.elastomer, displacement, traction, grid.step_mm)
    friction = np.hypot(traction[0], traction[1])
    # Without friction the object moves no point sideways: it presses at every position.
    press_only = problem.friction == 0 or not state.motion.tangential
    by_press = displacement[:2] if press_only else state.press_displacement_mm
    markers, markers_by_press = displacement, by_press
    if problem.elastomer.marker_depth_mm > 0:
        markers = problem.interior_displacement_mm(traction)
        pressed = markers if press_only else problem.interior_displacement_mm(state.press_traction_mpa)
        markers_by_press = pressed[:2]
    fields = [
        np.ascontiguousarray(np.moveaxis(values, 0, -1))
        for values in (displacement, by_press, markers, markers_by_press, young_mpa * traction)
    ]
    contact = Contact(
        x_mm=grid.x_mm,
        y_mm=grid.y_mm,
        displacement_mm=fields[0],
        press_displacement_mm=fields[1],
        marker_displacement_mm=fields[2],
        marker_press_displacement_mm=fields[3],
        traction_mpa=fields[4],
        in_contact=state.in_contact,
        slipping=state.in_contact & (friction >= (1 - 1e-9) * state.limit_mpa),
        force_n=young_mpa * traction.sum(axis=(1, 2)) * grid.step_mm**2,
        moment_nmm=young_mpa * _contact_moment(problem, state),
        largest_strain=strain,
        warnings=tuple(_contact_warnings(problem, state, strain)),
        iterations=state.iterations,
        residual_mm=state.residual_mm,
        thickness_mm=problem.elastomer.thickness_mm,
    )
    for values in (*fields, contact.in_contact, contact.slipping):
        values.setflags(write=False)
    return contact


def _contact_moment(problem: ContactProblem, state: ContactState) -> Array:
    """(3,) moment in N mm about the object's current centre, with lever arms in the plane of the flat surface.

    The tractions are those of linear theory, in the directions of the flat layer, and so are the arms: a twist turns
    neither. Both move with the centre of pressure, so that the load of a sheared object moves with the object.
    """
    centre = np.add(problem.indenter.centre_mm, state.motion.shear_mm)
    force = state.traction_mpa * problem.grid.step_mm**2
    moved = np.zeros(2)
    if force[2].any():
        moved = (state.displacement_mm[:2] * force[2]).sum(axis=(1, 2)) / force[2].sum()
    x, y = problem.grid.xy_mm + np.reshape(moved - centre, (2, 1, 1))
    fx, fy, fz = force
    return np.array([np.sum(y * fz), -np.sum(x * fz), np.sum(x * fy - y * fx)])


def _contact_warnings(problem: ContactProblem, state: ContactState, strain: float) -> Iterator[str]:
    step, thickness = problem.grid.step_mm, problem.elastomer.thickness_mm
    if not state.in_contact.any():
        if state.motion.press_mm > 0:
            yield (
                "the object does not touch the solved area; move centre_mm, take a larger size_mm or a finer grid, "
                "or press more"
            )
        return
    if strain > LINEAR_STRAIN_LIMIT:
        yield (
            f"the largest strain is {strain:.2g}, above {LINEAR_STRAIN_LIMIT:g}: linear theory is an "
            f"estimate there, not a "
            "prediction; press or shear less, or take a thicker layer or an object with rounder edges"
        )
    if has_fold(state.displacement_mm, step):
        yield "the surface folds over itself: its map has a negative Jacobian; press or shear less"
    yield from _grid_warnings(problem, state.in_contact)
    if step > thickness:
        yield (
            f"the grid's step of {step:.3g} mm is above the thickness of {thickness:.3g} mm; "
            f"take grid above {math.ceil(max(problem.grid.shape) * step / thickness)} or a smaller size_mm"
        )
    allowed_mm = (GAP_TOLERANCE_FRICTION if problem.friction > 0 else GAP_TOLERANCE) * state.motion.press_mm
    if state.residual_mm > allowed_mm:
        yield (
            f"the solver left a gap of {state.residual_mm:.2g} mm, above {allowed_mm:.2g} mm; "
            "take a coarser grid or rounder edges"
        )


def _grid_warnings(problem: ContactProblem, touched: NDArray[np.bool_]) -> Iterator[str]:
    step, radius = problem.grid.step_mm, problem.indenter.smallest_radius_mm
    if radius < step:
        yield (
            f"the object's sharpest edge has a radius of {radius:.3g} mm, below the grid's step of {step:.3g} mm: "
            "stress and strain there depend on the grid; take a finer grid or a rounder edge"
        )
    if np.count_nonzero(touched) < MIN_CONTACT_CELLS:
        yield (
            f"the contact covers {np.count_nonzero(touched)} cells of {step:.3g} mm, below {MIN_CONTACT_CELLS}; "
            "take a finer grid or a smaller size_mm"
        )
    at_edge = np.count_nonzero(touched) - np.count_nonzero(touched[1:-1, 1:-1])
    if at_edge:
        yield (
            f"the contact reaches the edge of the solved area in {at_edge} cells: no contact is computed "
            "beyond the edge, where the layer continues; take a larger size_mm or a smaller object"
        )


def has_fold(displacement_mm: Array, step_mm: float) -> bool:
    """Whether the Jacobian determinant of the plane's map by a displacement (3, ny, nx) is anywhere not positive."""
    ux_y, ux_x = np.gradient(displacement_mm[0], step_mm)
    uy_y, uy_x = np.gradient(displacement_mm[1], step_mm)
    return bool(((1 + ux_x) * (1 + uy_y) - ux_y * uy_x).min() <= 0)
