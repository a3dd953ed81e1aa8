"""The mold and the pad as build123d objects, for further design in CAD: a flange, a camera mount, a housing.

build123d belongs to the extra [cad]. ``build`` does not use build123d: the kernel's
exporter takes several times as long as ``step``, and its assemblies differ from run to run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from cmpdesign.design.design import Design
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.libraries import extra
from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.mold.checks.findings import check_mold, require_no_errors
from cmpdesign.products.mold.finish import check_part
from cmpdesign.products.mold.pad import CLEAR_COLOR, SKIN_COLOR, cured_stack
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.shapes.dish import make_bare_dish
from cmpdesign.products.mold.shapes.dished_solids import dished_sheet_solid
from cmpdesign.products.mold.solids.slab_shells import Slab, make_slab_solid
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack, make_stack


def mold_parts(design: Design, layout: Layout | None = None) -> Any:
    """Build the parts of a design's mold.

    Every part is at its place of use, in mm: z = 0 is the back of the pad, and boss plates are turned over. Plates and
    stencils of different colors are used one after the other and therefore have the same place. Dowels are "pin-1",
    "pin-2" and so on; the other labels are the names of the STEP files ("base", "boss-red").

    Args:
        design: the design.
        layout: its layout; None: it is built.

    Returns:
        A build123d ``Compound`` with the design's name; its children are labelled, colored, located ``Solid`` objects.

    Raises:
        CmpDesignError: build123d is not installed.
        DesignError: the mold cannot be made.
        MoldError: a solid is open, invalid or of another volume than computed.
    """
    stack = make_stack(design, layout if layout is not None else build_layout(design))
    require_no_errors(check_mold(stack))
    parts = make_parts(stack)
    for part in parts:
        check_part(part)
    return _compound(f"{design.name} mold", [solid for part in parts for solid in _placed_solids(part)])


def pad_parts(design: Design, layout: Layout | None = None) -> Any:
    """Build the silicone layers of a design's pad, cured, each without its cavities.

    Args:
        design: the design.
        layout: its layout; None: it is built.

    Returns:
        A build123d ``Compound`` with the children "base", "marker" and "cover" in mm, z = 0 at the pad's back.

    Raises:
        CmpDesignError: build123d is not installed.
        DesignError: the mold cannot be made.
    """
    stack = make_stack(design, layout if layout is not None else build_layout(design))
    require_no_errors(check_mold(stack))
    return _compound(f"{design.name} pad", list(_silicone_layers(cured_stack(stack))))


class _PlacedSolid(NamedTuple):
    """A solid (TopoDS_Solid), its label and color, and its place: turned about the x axis, then moved."""

    label: str
    color: str
    shape: Any
    xyz_mm: tuple[float, float, float]
    turned: bool = False


def _placed_solids(part: Part) -> Iterator[_PlacedSolid]:
    if part.slab is not None:
        yield _PlacedSolid(part.name, part.color, part.solid, (0.0, 0.0, part.z_mm), part.turned)
        return
    for number, (x, y) in enumerate(part.stack.pins_mm.tolist(), start=1):
        # Each dowel is a separate shape: exporters give a shape that is used twice one label.
        dowel = replace(part).solid
        yield _PlacedSolid(f"{part.name}-{number}", part.color, dowel, (x, y, part.z_mm))


def _silicone_layers(pad: MoldStack) -> Iterator[_PlacedSolid]:
    heights = (0.0, pad.z_base_mm, pad.z_marker_mm)
    colors = (CLEAR_COLOR, pad.layout.palette[COLORS[BLACK]], SKIN_COLOR)
    for number, name in enumerate(SILICONE_LAYERS):
        lower, upper = pad.edges(number)
        slab = Slab(lower, 0.0, pad.thickness_mm[number], outer_top=upper)
        flat = pad.crown is None
        shape = make_slab_solid(slab) if flat else dished_sheet_solid(slab, make_bare_dish(pad))
        yield _PlacedSolid(name, colors[number], shape, (0.0, 0.0, heights[number]))


def _compound(label: str, solids: Sequence[_PlacedSolid]) -> Any:
    with extra("cad"):
        from build123d import Color, Compound, Location, Solid
    children = []
    for one in solids:
        child = Solid(one.shape).moved(Location(one.xyz_mm, (180.0 if one.turned else 0.0, 0.0, 0.0)))
        child.label = one.label
        child.color = Color(*(int(one.color[start : start + 2], 16) / 255 for start in (1, 3, 5)))
        children.append(child)
    return Compound(label=label, children=children)
