"""Outlines of one boss and of one stencil hole over one cell."""

from __future__ import annotations

import numpy as np

from cmpdesign.mold.loops import Loop, Points, polygon, rounded
from cmpdesign.mold.shells import Feature
from cmpdesign.mold.stack import Stack

# A stencil's hole widens upwards, so that the paste lets go when it is lifted.
STENCIL_LEAN = float(np.tan(np.radians(10.0)))


def root_corners(stack: Stack, cell: Points) -> Points:
    """The cavity at its open side: the cell less half the gap on every side."""
    return polygon(cell).moved(-stack.options.gap_mm / 2).points


def boss(stack: Stack, cell: Points) -> Feature:
    """A boss: as wide as the cavity's open side at its root, narrower by the draft at its tip.

    The radius of the upright edges is the given one at the tip and grows with the draft towards the root.
    """
    height = stack.thickness_mm[1]
    narrower = stack.lean * height
    radius = stack.options.tip_radius_mm
    root = rounded(root_corners(stack, cell), radius + narrower if radius else 0.0)
    return Feature(root, root.moved(-narrower), height)


def stencil_hole(stack: Stack, cell: Points) -> tuple[Loop, Loop]:
    """A stencil's hole at its lower and upper face; below, it keeps its clearance to the cavity's rim."""
    corners = polygon(root_corners(stack, cell)).moved(-stack.options.clearance_mm).points
    below = rounded(corners, stack.options.tip_radius_mm)
    return below, below.moved(STENCIL_LEAN * stack.options.stencil_mm)
