"""Triangle meshes of the finished pad at cured size: base, black layer, fillings by color, protective layer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cmpdesign.patterns.colors import BLACK, COLORS
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh
from cmpdesign.products.mold.shapes.bosses import boss_features
from cmpdesign.products.mold.shapes.dish import Dish, make_bare_dish, make_dish
from cmpdesign.products.mold.shapes.dished_solids import dished_sheet_solid, dished_volume_mm3
from cmpdesign.products.mold.solids.loops import Loop, chorded_pair, frustum_volume_mm3
from cmpdesign.products.mold.solids.slab_shells import Slab, make_slab_solid, slab_volume_mm3
from cmpdesign.products.mold.solids.tessellate import Frustum, frusta_mesh, tessellate_solid
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack

CLEAR_COLOR, SKIN_COLOR = "#d8e8f0", "#e8e4dc"


def cured_stack(stack: MoldStack) -> MoldStack:
    """The stack without shrinkage: the dimensions of the cured silicone."""
    base, marker, cover = (
        s.model_copy(update={"shrinkage_percent": s.shrinkage_percent.model_copy(update={"value": 0.0})})
        for s in stack.silicones
    )
    crown = stack.crown
    if crown is not None:
        scale = 1 / stack.silicones[1].scale
        crown = replace(
            crown,
            radius_mm=crown.radius_mm * scale,
            reach_mm=crown.reach_mm * scale,
            length_mm=crown.length_mm * scale,
        )
    return replace(stack, silicones=(base, marker, cover), crown=crown)


def pad_meshes(stack: MoldStack) -> Iterator[tuple[TriangleMesh, float]]:
    """The mesh of every silicone layer and filling with its volume in closed form (mm3), z = 0 at the pad's back."""
    pad = cured_stack(stack)
    heights = (0.0, pad.z_base_mm, pad.z_marker_mm, pad.z_cover_mm)
    colors = (CLEAR_COLOR, pad.layout.palette[COLORS[BLACK]], SKIN_COLOR)
    for silicone_layer, color in enumerate(colors):
        yield _silicone_layer_mesh(pad, silicone_layer, color, heights[silicone_layer])
        if silicone_layer == 1:
            for number in pad.colors:
                yield _filling_mesh(pad, number, heights[1])


def _silicone_layer_mesh(
    pad: MoldStack, silicone_layer: int, color: str, z: float
) -> tuple[TriangleMesh, float]:
    """The mesh of a silicone layer at height z, and its volume."""
    edges, thickness = pad.edges(silicone_layer), pad.thickness_mm[silicone_layer]
    name = "black" if silicone_layer == 1 else SILICONE_LAYERS[silicone_layer]
    if pad.crown is not None:
        slab = Slab(edges[0], 0.0, thickness, outer_top=edges[1])
        dish = make_bare_dish(pad) if silicone_layer != 1 else _cavity_dish(pad)
        mesh = tessellate_solid(name, color, dished_sheet_solid(slab, dish)).moved(0, 0, z)
        return mesh, dished_volume_mm3(slab, dish, "sheet")
    if silicone_layer != 1:
        return frusta_mesh(name, color, [_upright_frustum(*edges, z, thickness)]), frustum_volume_mm3(
            *edges, thickness
        )
    through = [pair for number in pad.colors for pair in _cavity_outlines(pad, number)]
    slab = Slab(edges[0], 0.0, thickness, many_through=through, outer_top=edges[1])
    return tessellate_solid(name, color, make_slab_solid(slab)).moved(0, 0, z), slab_volume_mm3(slab)


def _cavity_outlines(pad: MoldStack, color: int) -> list[tuple[Loop, Loop]]:
    """The outlines of each cavity at the base and at its open side."""
    return [chorded_pair(part.tip, part.root) for part in boss_features(pad, color)]


def _cavity_dish(pad: MoldStack) -> Dish:
    """The dish with the cavities of all colors, from the base to the open side."""
    dishes = [make_dish(pad, color, through=False) for color in pad.colors]
    outlines = {cell: (tip, root) for dish in dishes for cell, (root, tip) in dish.outlines.items()}
    return replace(dishes[0], outlines=outlines)


def _filling_mesh(pad: MoldStack, color: int, z: float) -> tuple[TriangleMesh, float]:
    """The mesh of a color's fillings, whose base is at height z, and its volume."""
    name, thickness = COLORS[color], pad.thickness_mm[1]
    if pad.crown is None:
        frusta = [_upright_frustum(*pair, z, thickness) for pair in _cavity_outlines(pad, color)]
    else:
        dish = make_dish(pad, color, through=False)
        frusta = [
            Frustum(tip, z + dish.z_at(cell, tip.points), root, z + thickness + dish.z_at(cell, root.points))
            for cell, (root, tip) in dish.outlines.items()
        ]
    mesh = frusta_mesh(name, pad.layout.palette[name], frusta)
    return mesh, sum(frustum_volume_mm3(one.lower, one.upper, thickness) for one in frusta)


def _upright_frustum(lower: Loop, upper: Loop, z: float, thickness: float) -> Frustum:
    """The frustum from z to z + thickness."""
    m = len(lower.points)
    return Frustum(lower, np.full(m, z), upper, np.full(m, z + thickness))
