"""Outlines of bosses and of stencil holes over cells."""

from __future__ import annotations

import numpy as np

from cmpdesign.products.mold.shapes.cavities import cavities, open_insets
from cmpdesign.products.mold.solids.loops import Loop, inset_cells
from cmpdesign.products.mold.solids.slab_shells import Feature
from cmpdesign.products.mold.stack.stack import MoldStack

# Tangent of the walls' angle: a stencil's hole widens upwards, so that the stencil releases the paste.
STENCIL_LEAN = float(np.tan(np.radians(10.0)))


def boss_features(stack: MoldStack, color: int) -> list[Feature]:
    """Bosses of a color in plan: the tip is the visible cell, the root the cavity's open side."""
    height = stack.thickness_mm[1]
    return [Feature(cavity.open, cavity.seen, height) for cavity in cavities(stack, color)]


def stencil_hole_outlines(stack: MoldStack, color: int) -> list[tuple[Loop, Loop]]:
    """Outlines of a stencil's holes over a color's cells, at the lower and the upper face.

    The lower outlines keep ``clearance_mm`` from the rims of the cavities.
    """
    widening = STENCIL_LEAN * stack.options.stencil_mm
    inset = open_insets(stack, color) + stack.options.clearance_mm
    radius = stack.options.tip_radius_mm
    cells = stack.cells(color)
    below = inset_cells(cells, inset, radius)
    above = inset_cells(cells, inset - widening, radius + widening if radius else 0.0)
    return list(zip(below, above, strict=True))
