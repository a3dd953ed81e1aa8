"""Contact as a quadratic program: Newton steps on the tractions that are free, by preconditioned conjugate gradients.

Minimise  1/2 t.Ct - t.b  over  t_z <= 0 (no adhesion)  and  |(t_x, t_y)| <= limit  in every cell. Its gradient Ct - b
is the gap that is left: 0 where tractions are free, of one sign where they are not. Each step guesses from tractions
and gap what presses, sticks and slips (the primal-dual active set of Hintermueller, Ito & Kunisch, SIAM J. Optim. 13,
2003), and then closes the gap of those for a while: what slips may turn its friction along the limit's circle. The
layer's inverse in Fourier space, where it is diagonal but for the edges, is the preconditioner.

Coulomb's limit is the friction coefficient times the pressure that is sought. It is renewed from the pressure before
every step: Panagiotopoulos' fixed point (1975), but not solved out for every limit on the way.

Steps are made with single precision, which is as good as the tolerance by far. What is handed out was checked, and
corrected, with double, unless it is but a start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.contact.elastic_layer.operator import ComplianceOperator
from cmpdesign.contact.friction.admissible import ActiveSet, AdmissibleTractions

Array = NDArray[np.float64]
Single = NDArray[np.float32]
MAX_ITERATIONS = 2000
# How far the gap pulls tractions when guessing what slips and lets go, over the largest eigenvalue. Guesses that do not
# lead to a smaller gap within some steps are made with less, and the limit then stays until its problem is solved.
ACTIVE_SET_GAIN, MIN_ACTIVE_SET_GAIN, MAX_STALLED_STEPS = 4.0, 1.0, 8
# A step ends when the gap of what is free has shrunk to this, or after so many conjugate gradients.
STEP_GAP_REDUCTION, MAX_DIRECTIONS = 0.1, 3


class TractionSolution(NamedTuple):
    """Tractions, what they were allowed at last, applications of C, and the gap that is left in mm (RMS).

    The gap is above the tolerance only if the iteration did not converge.
    """

    traction_mpa: Array
    allowed: AdmissibleTractions
    operator_applications: int
    residual_gap_mm: float


def minimise(
    operator: ComplianceOperator,
    b: Array,
    allowed: AdmissibleTractions,
    t: Array,
    *,
    tolerance_mm: float,
    steady: float = 0.0,
    checked: bool = True,
) -> TractionSolution:
    """Tractions that leave no more than ``tolerance_mm`` of gap, as a root mean square over the loaded cells.

    Args:
        operator: the layer's answer C.
        b: the displacement that the object asks for, shaped as t.
        t: where to start, (3, rows, columns), or (1, rows, columns) for pressure alone.
        steady: the change of the limit that is taken for none.
        checked: with double precision, before it is handed out.
    """
    largest = operator.eigenvalue_bound(len(t))
    t = allowed.project(t)
    gap, applied, exact = operator(t.astype(np.float32)) - b, 1, False
    pull, patient = ACTIVE_SET_GAIN, False
    left, least, stalled = np.inf, np.inf, 0
    while True:
        change = allowed.change(t)
        if not patient or left <= tolerance_mm:
            allowed, least = allowed.with_updated_limit(t), np.inf if patient else least
        face = allowed.face(t, t - pull / largest * gap)
        if (face.projected_mpa != t).any():
            gap, exact = gap + operator((face.projected_mpa - t).astype(np.float32)), False
            applied += 1
            t = face.projected_mpa
        left = _residual_gap_mm(allowed, t, gap, largest)
        if checked and not exact and left <= tolerance_mm and change <= steady:
            gap, exact = operator(t) - b, True
            applied += 1
            left = _residual_gap_mm(allowed, t, gap, largest)
        if applied >= MAX_ITERATIONS or (left <= tolerance_mm and change <= steady):
            return TractionSolution(t, allowed, applied, left)
        least, stalled = (left, 0) if left < 0.9 * least else (least, stalled + 1)
        if stalled >= MAX_STALLED_STEPS:
            pull, patient, least, stalled = max(pull / 2, MIN_ACTIVE_SET_GAIN), True, np.inf, 0
        step, answer, more = _newton_step(operator, face, gap, tolerance_mm)
        # A step that moves nothing counts too, so that there is an end.
        t, gap, applied, exact = t + step, gap + answer, applied + max(more, 1), False


def _residual_gap_mm(allowed: AdmissibleTractions, t: Array, gap: Array, largest: float) -> float:
    """Root mean square in mm of the gap that allowed tractions could still close, over the free components."""
    to_go = (t - allowed.project(t - gap / largest)) * largest
    return float(np.sqrt(np.sum(to_go**2) / max(int(np.count_nonzero(allowed.free(t))), 1)))


def _newton_step(
    operator: ComplianceOperator, face: ActiveSet, gap: Array, tolerance_mm: float
) -> tuple[Single, Single, int]:
    """A change of the tractions that closes most of the gap of what is free, its answer, and applications of C."""
    step, answer = np.zeros_like(gap, dtype=np.float32), np.zeros_like(gap, dtype=np.float32)
    turning = face.turning_resistance(gap)
    # What turns with effort is scaled down to what the layer's inverse is made for.
    soft = np.ones_like(step)
    soft[:-1] = np.sqrt(operator.stiffest / (operator.stiffest + turning))
    rest = face.project_on_free_directions(-gap.astype(np.float32))
    free = float(np.count_nonzero(face.free_mask))
    enough = max(STEP_GAP_REDUCTION**2 * float(np.vdot(rest, rest)), 0.1 * tolerance_mm**2 * free)
    ahead, before = np.zeros_like(step), np.inf
    for applied in range(MAX_DIRECTIONS + 1):
        if applied == MAX_DIRECTIONS or float(np.vdot(rest, rest)) <= enough:
            break
        undone = face.project_on_free_directions(soft * operator.precondition(soft * rest))
        strength = float(np.vdot(rest, undone))
        ahead = undone + (strength / before) * ahead
        moved = operator(ahead)
        resisted = moved.copy()
        resisted[:-1] += turning * ahead[:-1]
        way = strength / float(np.vdot(ahead, resisted))
        step += way * ahead
        answer += way * moved
        rest -= way * face.project_on_free_directions(resisted)
        before = strength
    return step, answer, applied
