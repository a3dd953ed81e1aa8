"""Outlines of one boss and of one stencil hole over one cell."""

from __future__ import annotations

import numpy as np

from cmpdesign.products.mold.solids.loops import Loop, Points, inset_cells
from cmpdesign.products.mold.solids.slab_shells import Feature
from cmpdesign.products.mold.stack.stack import MoldStack

# A stencil's hole widens upwards, so that the paste lets go when it is lifted.
STENCIL_LEAN = float(np.tan(np.radians(10.0)))


def boss_features(stack: MoldStack, cells: Points) -> list[Feature]:
    """Bosses: as wide as the cavity's open side at the root, narrower by the draft at the tip.

    The radius of the upright edges is the given one at the tip and grows with the draft towards the root.
    """
    height, inset = stack.thickness_mm[1], stack.options.gap_mm / 2
    narrower = stack.lean * height
    radius = stack.options.tip_radius_mm
    roots = inset_cells(cells, inset, radius + narrower if radius else 0.0)
    tips = inset_cells(cells, inset + narrower, radius)
    return [Feature(root, tip, height) for root, tip in zip(roots, tips, strict=True)]


def stencil_hole_outlines(stack: MoldStack, cells: Points) -> list[tuple[Loop, Loop]]:
    """A stencil's holes at its lower and upper face; below, they keep clear of the cavities' rims."""
    inset = stack.options.gap_mm / 2 + stack.options.clearance_mm
    wider = STENCIL_LEAN * stack.options.stencil_mm
    radius = stack.options.tip_radius_mm
    below = inset_cells(cells, inset, radius)
    above = inset_cells(cells, inset - wider, radius + wider if radius else 0.0)
    return list(zip(below, above, strict=True))
