"""The finished pad as meshes: base, black layer, fillings by color, protective layer; at its cured size."""

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
from cmpdesign.products.mold.solids.tessellate import frusta_mesh, tessellate_solid
from cmpdesign.products.mold.stack.stack import SILICONE_LAYERS, MoldStack

CLEAR_COLOR, SKIN_COLOR = "#d8e8f0", "#e8e4dc"


def cured_stack(stack: MoldStack) -> MoldStack:
    """The same stack without shrinkage: what is left when the silicone has cured."""
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
    """Every layer's and color's mesh with its volume in closed form, at cured size, z = 0 at the back."""
    pad = cured_stack(stack)
    heights = (0.0, pad.z_base_mm, pad.z_marker_mm, pad.z_cover_mm)
    for layer, color in ((0, CLEAR_COLOR), (1, pad.layout.palette[COLORS[BLACK]]), (2, SKIN_COLOR)):
        name = "black" if layer == 1 else SILICONE_LAYERS[layer]
        yield _layer_mesh(pad, layer, name, color, heights[layer])
        if layer == 1:
            for number in pad.colors:
                yield _filling_mesh(pad, number, heights[1])


def _layer_mesh(pad: MoldStack, layer: int, name: str, color: str, z: float) -> tuple[TriangleMesh, float]:
    edges, thickness = pad.edges(layer), pad.thickness_mm[layer]
    if pad.crown is not None:
        slab = Slab(edges[0], 0.0, thickness, outer_top=edges[1])
        dish = make_bare_dish(pad) if layer != 1 else _cavity_dish(pad)
        mesh = tessellate_solid(name, color, dished_sheet_solid(slab, dish)).moved(0, 0, z)
        return mesh, dished_volume_mm3(slab, dish, "sheet")
    if layer != 1:
        m = len(edges[0].points)
        mesh = frusta_mesh(name, color, [(edges[0], np.full(m, z), edges[1], np.full(m, z + thickness))])
        return mesh, frustum_volume_mm3(*edges, thickness)
    through = [pair for number in pad.colors for pair in _cavity_outlines(pad, number)]
    slab = Slab(edges[0], 0.0, thickness, many_through=through, outer_top=edges[1])
    return tessellate_solid(name, color, make_slab_solid(slab)).moved(0, 0, z), slab_volume_mm3(slab)


def _cavity_outlines(pad: MoldStack, color: int) -> list[tuple[Loop, Loop]]:
    """Each cavity's outline at the base and at its open side."""
    return [chorded_pair(part.tip, part.root) for part in boss_features(pad, pad.cells(color))]


def _cavity_dish(pad: MoldStack) -> Dish:
    """A dish with all colors' cavities, from the base to the open side."""
    dishes = [make_dish(pad, color, through=False) for color in pad.colors]
    outlines = {cell: (tip, root) for dish in dishes for cell, (root, tip) in dish.outlines.items()}
    return replace(dishes[0], outlines=outlines)


def _filling_mesh(pad: MoldStack, color: int, z: float) -> tuple[TriangleMesh, float]:
    name, thickness = COLORS[color], pad.thickness_mm[1]
    if pad.crown is None:
        pairs = _cavity_outlines(pad, color)
        frusta = [(a, np.full(len(a.points), z), b, np.full(len(b.points), z + thickness)) for a, b in pairs]
    else:
        dish = make_dish(pad, color, through=False)
        frusta = [
            (tip, z + dish.z_at(cell, tip.points), root, z + thickness + dish.z_at(cell, root.points))
            for cell, (root, tip) in dish.outlines.items()
        ]
        pairs = [(tip, root) for root, tip in dish.outlines.values()]
    mesh = frusta_mesh(name, pad.layout.palette[name], frusta)
    return mesh, sum(frustum_volume_mm3(a, b, thickness) for a, b in pairs)
