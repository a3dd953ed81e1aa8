"""Bending of the gridlines beyond the smooth map: two more unknowns for each gridline, free where markers are rough.

The map that the markers define is smooth over two rings of markers. Where an object's rim lies between markers, or
slips, gridlines bend more sharply. The sharpness is limited by the third differences of the markers along their
gridlines, which are 0 where the map is quadratic. A gridline then deviates from the map's cubic by

    t (1 - t) (b + s (1 - 2 t)),

t along the chord, b and s of zero mean and a deviation that is a share of these differences. The share, from
``min_bend_share`` to ``max_bend_share``, follows from the surrounding gridlines: their bending above the part that
noise explains. Both unknowns are eliminated from a gridline's sums before the markers are solved, and computed
afterwards.
"""

from __future__ import annotations

from typing import NamedTuple

from extractor.refine.synthesis.pixel_rows import LIMITS as PIXEL_LIMITS


class BendingLimits(NamedTuple):
    """Limits of the bending b and s.

    Attributes:
        min_bend_share, max_bend_share: b and s over the differences around them (RMS) where these are smooth, and at
            most; from the surfaces under balls that press, shear and twist. Measured on these, by no command that is
            kept.
        bend_to_end_shift: the shift of a gridline's ends that remains, in deviations of b and s; from these surfaces.
            Measured on them, likewise.
        max_bend_deviation: in units of the gridline's length. Chosen.
        third_difference_noise: the noise of four markers in a third difference, 1 + 9 + 9 + 1, in two axes, with some
            allowance for its scatter. Derived: twice 20, times an allowance of 2, which is chosen.
        mean_over_median: a mean of squares against their median. Chosen near the 2.2 of the square of a normal
            variable.
        misfit_tolerance: five deviations of the shift of the ends, squared. Chosen.
        max_misfit_tolerance: the most of that, in units of the blur, squared. Chosen.
        min_significance: deviations by which bending must exceed its noise. Chosen.
        max_bend: b and s, in units of the gridline's length. Chosen.
        min_determinant_share: of the product of the sums at both ends; a gridline whose determinant is smaller does not
            show bending. Chosen.
        min_information_share: of the information about b with both ends held; a gridline with less does not show
            bending. Chosen.
        band: in units of the blur, the distance from a gridline within which pixels count. Derived: as in
            ``PixelRowLimits``.
    """

    min_bend_share: float = 0.01
    max_bend_share: float = 0.25
    bend_to_end_shift: float = 0.08
    max_bend_deviation: float = 0.06
    third_difference_noise: float = 2 * 20 * 2.0
    mean_over_median: float = 2.0
    misfit_tolerance: float = 25.0
    max_misfit_tolerance: float = 0.1
    min_significance: float = 3.0
    max_bend: float = 0.3
    min_determinant_share: float = 1e-6
    min_information_share: float = 1e-3
    band: float = PIXEL_LIMITS.band


LIMITS = BendingLimits()
