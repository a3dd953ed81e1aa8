"""Outlines of bosses and of stencil holes over cells."""

from __future__ import annotations

import numpy as np

from cmpdesign.products.mold.solids.loops import Loop, Points, inset_cells
from cmpdesign.products.mold.solids.slab_shells import Feature
from cmpdesign.products.mold.stack.stack import MoldStack

# Tangent of the walls' lean: a stencil's hole widens upwards, so that the stencil releases the paste.
STENCIL_LEAN = float(np.tan(np.radians(10.0)))


def boss_features(stack: MoldStack, cells: Points) -> list[Feature]:
    """Bosses over (N, k, 2) cells: as wide as the cavity's open side at the root, narrower by the draft at the tip.

    The radius of the upright edges is ``tip_radius_mm`` at the tip and grows with the draft towards the root.
    """
    height, inset = stack.thickness_mm[1], stack.options.gap_mm / 2
    draft = stack.lean * height
    radius = stack.options.tip_radius_mm
    roots = inset_cells(cells, inset, radius + draft if radius else 0.0)
    tips = inset_cells(cells, inset + draft, radius)
    return [Feature(root, tip, height) for root, tip in zip(roots, tips, strict=True)]


def stencil_hole_outlines(stack: MoldStack, cells: Points) -> list[tuple[Loop, Loop]]:
    """Outlines of a stencil's holes at the lower and the upper face, over (N, k, 2) cells.

    The lower outlines keep ``clearance_mm`` from the rims of the cavities.
    """
    inset = stack.options.gap_mm / 2 + stack.options.clearance_mm
    widening = STENCIL_LEAN * stack.options.stencil_mm
    radius = stack.options.tip_radius_mm
    below = inset_cells(cells, inset, radius)
    above = inset_cells(cells, inset - widening, radius + widening if radius else 0.0)
    return list(zip(below, above, strict=True))
