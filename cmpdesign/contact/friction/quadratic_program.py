"""Contact as a quadratic program: Newton iterations on the free tractions, by preconditioned conjugate gradients.

Minimise  1/2 t.Ct - t.b  over  t_z <= 0 (no adhesion)  and  |(t_x, t_y)| <= limit  in every cell. The gradient Ct - b
is the remaining gap: 0 where tractions are free, of one sign where they are not. Each iteration estimates from
tractions and gap which cells press, stick and slip (the primal-dual active set of Hintermueller, Ito & Kunisch, SIAM
J. Optim. 13, 2003). Then a few conjugate gradient directions reduce the gap of the free components. The friction of
slipping cells may rotate along the limit's circle. The preconditioner is the elastic layer's inverse in Fourier space,
where C is diagonal except for the effect of the box's edges.

Coulomb's limit is the friction coefficient times the unknown pressure. Before every iteration the limit is updated from
the current pressure: Panagiotopoulos' fixed point (1975), without solving the problem of every intermediate limit.

Iterations use single precision, which is far finer than the tolerance. A verified result has been checked, and
corrected, in double precision.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.operator import ComplianceOperator
from cmpdesign.contact.friction.admissible import ActiveSet, AdmissibleTractions

Array = NDArray[np.float64]
Single = NDArray[np.float32]
MAX_ITERATIONS = 2000  # applications of C
# Gain of the gap in the prediction of slip and separation, in units of 1 / largest eigenvalue. When the gap has not
# decreased for MAX_STALLED_STEPS iterations, the gain is halved and the limit is held until its problem is solved.
ACTIVE_SET_GAIN, MIN_ACTIVE_SET_GAIN, MAX_STALLED_STEPS = 4.0, 1.0, 8
# A Newton iteration ends when the gap of the free components has shrunk to this share, or after so many directions.
STEP_GAP_REDUCTION, MAX_DIRECTIONS = 0.1, 3


class TractionSolution(NamedTuple):
    """The result of ``minimise``.

    Attributes:
        traction_mpa: (3, rows, columns) or (1, rows, columns) float64.
        admissible: the final set of admissible tractions.
        operator_applications: how often C was applied.
        residual_gap_mm: RMS of the remaining gap; above the tolerance only if the iteration did not converge.
    """

    traction_mpa: Array
    admissible: AdmissibleTractions
    operator_applications: int
    residual_gap_mm: float


class NewtonStep(NamedTuple):
    """One Newton iteration.

    Attributes:
        traction_change: float32 MPa, shaped as the tractions.
        gap_change: float32 mm, C applied to ``traction_change``.
        operator_applications: how often C was applied.
    """

    traction_change: Single
    gap_change: Single
    operator_applications: int


def minimise(
    operator: ComplianceOperator,
    target_mm: Array,
    admissible: AdmissibleTractions,
    t: Array,
    *,
    tolerance_mm: float,
    limit_tolerance: float = 0.0,
    verify: bool = True,
) -> TractionSolution:
    """Find tractions with a remaining gap of at most ``tolerance_mm``, root mean square over the loaded cells.

    Args:
        operator: the elastic layer's response C.
        target_mm: b, the displacement that the object imposes, shaped as t.
        admissible: the admissible tractions.
        t: the initial tractions in MPa, (3, rows, columns), or (1, rows, columns) for pressure alone.
        tolerance_mm: of the gap.
        limit_tolerance: the relative change of the friction limit that is accepted.
        verify: check the result in double precision.
    """
    largest = operator.eigenvalue_bound(len(t))
    t = admissible.project(t)
    gap, applications, is_exact = operator(t.astype(np.float32)) - target_mm, 1, False
    gain, hold_limit = ACTIVE_SET_GAIN, False
    residual_mm, best_mm, stalled = np.inf, np.inf, 0
    while True:
        change = admissible.limit_change(t)
        if not hold_limit or residual_mm <= tolerance_mm:
            admissible, best_mm = admissible.with_updated_limit(t), np.inf if hold_limit else best_mm
        active = admissible.active_set(t, t - gain / largest * gap)
        if (active.projected_mpa != t).any():
            gap, is_exact = gap + operator((active.projected_mpa - t).astype(np.float32)), False
            applications += 1
            t = active.projected_mpa
        residual_mm = _residual_gap_mm(admissible, t, gap, largest)
        if verify and not is_exact and residual_mm <= tolerance_mm and change <= limit_tolerance:
            gap, is_exact = operator(t) - target_mm, True
            applications += 1
            residual_mm = _residual_gap_mm(admissible, t, gap, largest)
        if applications >= MAX_ITERATIONS or (residual_mm <= tolerance_mm and change <= limit_tolerance):
            return TractionSolution(t, admissible, applications, residual_mm)
        best_mm, stalled = (residual_mm, 0) if residual_mm < 0.9 * best_mm else (best_mm, stalled + 1)
        if stalled >= MAX_STALLED_STEPS:
            gain, hold_limit, best_mm, stalled = max(gain / 2, MIN_ACTIVE_SET_GAIN), True, np.inf, 0
        newton = _newton_step(operator, active, gap, tolerance_mm)
        t, gap, is_exact = t + newton.traction_change, gap + newton.gap_change, False
        # An iteration without a change counts too, so that the loop ends.
        applications += max(newton.operator_applications, 1)


def _residual_gap_mm(admissible: AdmissibleTractions, t: Array, gap: Array, largest: float) -> float:
    """Root mean square in mm of the gap that admissible tractions could still close, over the free components."""
    closable_mm = (t - admissible.project(t - gap / largest)) * largest
    return float(
        np.sqrt(np.sum(closable_mm**2) / max(int(np.count_nonzero(admissible.free_components(t))), 1))
    )


def _newton_step(
    operator: ComplianceOperator, active: ActiveSet, gap: Array, tolerance_mm: float
) -> NewtonStep:
    """A change of the tractions that closes most of the free components' gap."""
    traction_change, gap_change = np.zeros_like(gap, dtype=np.float32), np.zeros_like(gap, dtype=np.float32)
    resistance = active.turning_resistance(gap)
    # Components with rotation resistance are scaled to the compliance that the preconditioner assumes.
    scale = np.ones_like(traction_change)
    compliance = operator.shortest_wave_compliance
    scale[:-1] = np.sqrt(compliance / (compliance + resistance))
    residual = active.project_on_free_directions(-gap.astype(np.float32))
    free = float(np.count_nonzero(active.free_mask))
    goal = max(STEP_GAP_REDUCTION**2 * float(np.vdot(residual, residual)), 0.1 * tolerance_mm**2 * free)
    direction, previous_product = np.zeros_like(traction_change), np.inf
    for applications in range(MAX_DIRECTIONS + 1):
        if applications == MAX_DIRECTIONS or float(np.vdot(residual, residual)) <= goal:
            break
        preconditioned = active.project_on_free_directions(scale * operator.precondition(scale * residual))
        product = float(np.vdot(residual, preconditioned))
        direction = preconditioned + (product / previous_product) * direction
        response = operator(direction)
        resisted = response.copy()
        resisted[:-1] += resistance * direction[:-1]
        length = product / float(np.vdot(direction, resisted))
        traction_change += length * direction
        gap_change += length * response
        residual -= length * active.project_on_free_directions(resisted)
        previous_product = product
    return NewtonStep(traction_change, gap_change, applications)
