"""The pad as cast in a mold, at the base layer, which the camera sees, at cured size."""

from __future__ import annotations

import numpy as np

from cmpdesign.layout.layout import Layout
from cmpdesign.layout.side import seen_side
from cmpdesign.products.as_made.made_pad import CORNER_SHARE, Cause, MadePad, make_pad
from cmpdesign.products.mold.shapes.cavities import cavities, seen_inset_mm
from cmpdesign.products.mold.solids.loops import Points
from cmpdesign.products.mold.stack.crown import project_from_crown
from cmpdesign.products.mold.stack.stack import MoldStack

# A loop's arcs in the made pad: chords of this angle stay within a micrometre of an arc of 0.1 mm radius.
CHORD_DEG = 15.0
# A marker's place is the mean of the places of these plates: red, green and blue.
PLATES_AT_A_MARKER = 3


def made_pad(layout: Layout, stack: MoldStack) -> MadePad:
    """The pad as cast.

    Args:
        layout: layout of the design.
        stack: its mold.
    """
    outlines: dict[int, Points] = {}
    for color in stack.colors:
        cells = np.flatnonzero(layout.cell_color == color).tolist()
        rings = [
            _in_layout(cavity.seen.with_chords(chord_deg=CHORD_DEG).points, layout, stack)
            for cavity in cavities(stack, color)
        ]
        outlines |= dict(zip(cells, rings, strict=True))
    option, inset = stack.options, seen_inset_mm(stack)
    # The gap causes the part of the common inset that remains without draft.
    by_gap = min(inset, option.gap_mm / 2)
    causes = (
        Cause("mold.tip_radius_mm", CORNER_SHARE * option.tip_radius_mm),
        Cause("mold.gap_mm", option.gap_mm / 2 + by_gap),
        Cause("mold.draft_deg", inset - by_gap),
    )
    # A plate lies anywhere within the clearance of its holes. Over a disc the variance is radius^2 / 4.
    variance = (option.clearance_mm / 2) ** 2 / 4 / PLATES_AT_A_MARKER
    in_order = [outlines[cell] for cell in layout.colored_cells.tolist()]
    return make_pad(layout, "mold", in_order, causes, round(variance, 9))


def _in_layout(plan_mm: Points, layout: Layout, stack: MoldStack) -> Points:
    """(N, 2) points of the mold's plan in the layout's frame, at cured size."""
    crown = stack.crown
    if crown is not None:
        plan_mm = project_from_crown(plan_mm, crown.shape, crown.radius_mm, stack.options.projection)
    points: Points = plan_mm / stack.silicones[1].scale
    return points if seen_side(layout.mirrored) == "back" else points * (-1.0, 1.0)
