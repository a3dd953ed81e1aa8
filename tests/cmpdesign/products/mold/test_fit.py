"""Parts of a mold in their places: no two overlap, and every clearance is measured on the solids."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from cmpdesign import build_layout, load
from cmpdesign.products.mold import make
from cmpdesign.products.mold.checks.findings import facet_sag_mm
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.shapes.bosses import STENCIL_LEAN, boss_features
from cmpdesign.products.mold.shapes.dish import make_dish
from cmpdesign.products.mold.shapes.dished_solids import dished_sheet_solid
from cmpdesign.products.mold.solids.measure import distance_mm, overlap_mm3, subshapes, volume_mm3
from cmpdesign.products.mold.solids.slab_shells import Slab, make_slab_solid
from cmpdesign.products.mold.stack.stack import MoldStack, make_stack
from cmpdesign.products.mold.step.assembly import PartPlace

DESIGNS = {
    "honeycomb": {"layers": "2", "mold.clearance_mm": "0.16"},
    "round, turned": {"pattern": "round", "layers": "2", "rotation_deg": "11"},
    "square": {"pattern": "square", "layers": "2", "mold.draft_deg": "4"},
    "sphere": {"layers": "2", "mold.crown": "sphere", "mold.crown_radius_mm": "9"},
    "cylinder": {
        "layers": "2", "mold.crown": "cylinder", "mold.crown_radius_mm": "9", "mold.projection": "vertical"
    },
}  # fmt: skip
NAMES = list(DESIGNS)
# The other colors' plates and stencils are made and placed alike.
GROUPS = ("1-base", "2-emboss-red", "3-fill-red", "-cover")


@cache
def parts(name: str) -> dict[str, Part]:
    design = load("honeycomb", DESIGNS[name])
    return {part.name: part for part in make_parts(make_stack(design, build_layout(design)))}


def stack(name: str) -> MoldStack:
    return parts(name)["base"].stack


@cache
def put(name: str, part: str, xyz_mm: tuple[float, float, float], turned: bool) -> Any:
    """A part's solid where the assembly has it."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec

    move = gp_Trsf()
    if turned:
        move.SetRotation(gp_Ax1(gp_Pnt(0.0, 0.0, 0.0), gp_Dir(1.0, 0.0, 0.0)), np.pi)
    move.SetTranslationPart(gp_Vec(*xyz_mm))
    return BRepBuilderAPI_Transform(parts(name)[part].solid, move, True).Shape()


def groups(name: str) -> dict[str, list[PartPlace]]:
    """The positions of each step, moved from the layout side by side to the frame of the mold."""
    found = {}
    for group in make.make_assembly(stack(name), list(parts(name).values())).groups:
        x = group.places[0].xyz_mm[0]
        moved = [PartPlace(p.part, p.name, (p.xyz_mm[0] - x, *p.xyz_mm[1:]), p.turned) for p in group.places]
        if group.name.endswith(GROUPS):
            found[group.name] = moved
    return found


def solid(name: str, place: PartPlace) -> Any:
    x, y, z = place.xyz_mm
    return put(name, place.part, (round(x, 9), y, z), place.turned)


def near(shape: Any, other: Any, reach_mm: float) -> Any:
    """The faces of a shape that come near another's box: all that a small distance can be measured to."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRep import BRep_Builder
    from OCP.BRepBndLib import BRepBndLib
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS_Compound

    around = Bnd_Box()
    BRepBndLib.Add_s(other, around)
    around.Enlarge(reach_mm)
    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for face in subshapes(shape, TopAbs_ShapeEnum.TopAbs_FACE):
        box = Bnd_Box()
        BRepBndLib.Add_s(face, box)
        if not box.IsOut(around):
            builder.Add(compound, face)
    return compound


def standing_wall(shape: Any) -> Any:
    """A pin's longest face: its cylinder without the chamfered ends."""
    from OCP.TopAbs import TopAbs_ShapeEnum

    return max(subshapes(shape, TopAbs_ShapeEnum.TopAbs_FACE), key=area_mm2)


def area_mm2(face: Any) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return float(properties.Mass())


@pytest.mark.parametrize("name", NAMES)
def test_no_two_parts_of_a_step_overlap(name: str) -> None:
    seen = set()
    for step, places in groups(name).items():
        for first, second in itertools.combinations(places, 2):
            pair = (first.part, first.xyz_mm, second.part, second.xyz_mm)
            if pair in seen or first.part == second.part:
                continue
            seen.add(pair)
            shared = overlap_mm3(solid(name, first), solid(name, second))
            assert shared == pytest.approx(0, abs=1e-9), (step, first.name, second.name)
    assert len(seen) > 25


def test_an_overlap_would_be_seen() -> None:
    frame, plate = (p for p in groups("honeycomb")["2-emboss-red"] if p.part in ("frame", "boss-red"))
    x, y, z = plate.xyz_mm
    sunk = put("honeycomb", "boss-red", (x, y, z - 0.01), True)
    area = stack("honeycomb").block.area_mm2() - stack("honeycomb").edges(1)[1].area_mm2()
    assert overlap_mm3(solid("honeycomb", frame), sunk) == pytest.approx(0.01 * area, rel=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_pins_sit_tight_in_the_base_and_have_their_clearance_elsewhere(name: str) -> None:
    for places in groups(name).values():
        pin = next(place for place in places if place.part == "pin")
        wall = standing_wall(solid(name, pin))
        for place in places:
            if place.part == "pin":
                continue
            wanted = 0.0 if place.part == "base" else stack(name).options.clearance_mm / 2
            hole = near(solid(name, place), solid(name, pin), 1.0)
            assert distance_mm(wall, hole) == pytest.approx(wanted, abs=1e-6), place.name


@pytest.mark.parametrize("name", NAMES)
def test_parts_lie_on_each_other(name: str) -> None:
    """Faces that touch: the parts' heights are those of the layers."""
    mold = stack(name)
    wanted = {"base": mold.z_base_mm, "frame": mold.z_marker_mm, "cover": mold.z_cover_mm}
    found = groups(name)
    for places in found.values():
        others = [place for place in places if place.part != "pin"]
        for below, above in itertools.pairwise(others):
            assert land_mm(solid(name, below), lowest=False) == pytest.approx(wanted[below.part], abs=1e-9)
            assert land_mm(solid(name, above), lowest=True) == pytest.approx(wanted[below.part], abs=1e-9)
    lid, frame = (next(p for p in list(found.values())[-1] if p.part == part) for part in ("lid", "frame"))
    gap = land_mm(solid(name, lid), lowest=True) - land_mm(solid(name, frame), lowest=False)
    assert gap == pytest.approx(mold.thickness_mm[2], abs=1e-9)


def land_mm(shape: Any, lowest: bool) -> float:
    """Height of the largest horizontal face with a normal down (or up), on which a part lies."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType
    from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    areas: dict[float, float] = {}
    for face in subshapes(shape, TopAbs_ShapeEnum.TopAbs_FACE):
        surface = BRepAdaptor_Surface(TopoDS.Face(face), False)
        if surface.GetType() != GeomAbs_SurfaceType.GeomAbs_Plane:
            continue
        plane = surface.Plane()
        normal = plane.Axis().Direction().Z() * (1 if plane.Direct() else -1)
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            normal = -normal
        if normal < -0.999999 if lowest else normal > 0.999999:
            height = round(plane.Location().Z(), 9)
            areas[height] = areas.get(height, 0.0) + area_mm2(face)
    return max(areas, key=lambda height: areas[height])


def black_layer(name: str) -> Any:
    """The black layer with its cavities as it is in the mold, where it is in the mold."""
    mold = stack(name)
    edges, thickness = mold.edges(1), mold.thickness_mm[1]
    if mold.crown is not None:
        dishes = [make_dish(mold, color, through=False) for color in mold.colors]
        cavities = {cell: (tip, root) for dish in dishes for cell, (root, tip) in dish.outlines.items()}
        dish = replace(
            dishes[0], outlines=cavities
        )  # with all colors' cavities, from the base to the open side
        layer = dished_sheet_solid(Slab(edges[0], 0.0, thickness, outer_top=edges[1]), dish)
    else:
        pairs = [(b.tip, b.root) for color in mold.colors for b in boss_features(mold, color)]
        layer = make_slab_solid(Slab(edges[0], 0.0, thickness, many_through=pairs, outer_top=edges[1]))
    return moved_up(layer, mold.z_base_mm)


def moved_up(shape: Any, z_mm: float) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf, gp_Vec

    move = gp_Trsf()
    move.SetTranslation(gp_Vec(0.0, 0.0, z_mm))
    return BRepBuilderAPI_Transform(shape, move, True).Shape()


@pytest.mark.parametrize("name", NAMES)
def test_bosses_fill_their_cavities_and_nothing_else(name: str) -> None:
    """A plate and the black layer share no volume; sunk by 20 um, its bosses would bite."""
    mold, layer = stack(name), black_layer(name)
    plate = parts(name)["boss-red"]
    assert overlap_mm3(put(name, "boss-red", (0.0, 0.0, mold.z_marker_mm), True), layer) == pytest.approx(
        0, abs=1e-7
    )
    lower = put(name, "boss-red", (0.0, 0.0, mold.z_marker_mm - 0.02), True)
    assert overlap_mm3(lower, layer) > 0.005 * mold.edges(1)[0].area_mm2()
    assert plate.turned


@pytest.mark.parametrize("name", NAMES)
def test_stencil_holes_keep_their_clearance_to_the_cavities(name: str) -> None:
    mold, layer = stack(name), black_layer(name)
    stencil = put(name, "stencil-red", (0.0, 0.0, mold.z_marker_mm), False)
    assert overlap_mm3(stencil, layer) == pytest.approx(0, abs=1e-7)
    # From a hole's own walls to the layer: what silicone has to pass is inside the cavity by the clearance.
    found = distance_mm(hole_walls(stencil, mold), layer)
    # The clearance is one along the layer; the walls lean by ten degrees.
    wanted = mold.options.clearance_mm * np.cos(np.arctan(STENCIL_LEAN))
    slope = np.cos(np.radians(mold.crown.slope_deg)) if mold.crown else 1.0
    assert wanted * slope - 1e-6 <= found <= wanted + 1e-6


def hole_walls(stencil: Any, mold: MoldStack) -> Any:
    """The walls of its holes over the pattern: the steep faces there."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRep import BRep_Builder
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepBndLib import BRepBndLib
    from OCP.GeomAbs import GeomAbs_SurfaceType
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS, TopoDS_Compound

    (left, bottom), (right, top) = mold.marker_xy_mm.min(axis=0), mold.marker_xy_mm.max(axis=0)
    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for face in subshapes(stencil, TopAbs_ShapeEnum.TopAbs_FACE):
        surface = BRepAdaptor_Surface(TopoDS.Face(face), False)
        steep = surface.GetType() != GeomAbs_SurfaceType.GeomAbs_Plane
        steep = steep or abs(surface.Plane().Axis().Direction().Z()) < 0.3
        box = Bnd_Box()
        BRepBndLib.Add_s(face, box)
        low, high = box.CornerMin(), box.CornerMax()
        within = low.X() > left and high.X() < right and low.Y() > bottom and high.Y() < top
        if steep and within:
            builder.Add(compound, face)
    return compound


@pytest.mark.parametrize("name", ["honeycomb", "square"])
def test_bosses_stand_on_the_base_layer(name: str) -> None:
    mold = stack(name)
    layer = make_slab_solid(Slab(mold.edges(0)[0], 0.0, mold.z_base_mm, outer_top=mold.edges(0)[1]))
    plate = put(name, "boss-red", (0.0, 0.0, mold.z_marker_mm), True)
    assert distance_mm(near(plate, layer, 0.1), layer) == pytest.approx(0, abs=1e-7)
    assert overlap_mm3(plate, layer) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("name", ["sphere", "cylinder"])
def test_bosses_sink_into_a_crowned_base_layer_by_the_facets_sag_at_most(name: str) -> None:
    """Tips are flat, the layer is not: the layer's middle under a tip is pressed, and no gap is left."""
    mold, dish = stack(name), parts(name)["boss-red"].dish
    assert mold.crown is not None
    found = []
    for cell, (_, tip) in dish.outlines.items():
        places = np.concatenate([tip.points, tip.points.mean(axis=0)[None]])
        found.append(mold.crown.z_mm(places) - dish.z_at(cell, places))
    depths = np.concatenate(found)
    assert depths.min() > -1e-9
    assert 0.3 * facet_sag_mm(mold) < depths.max() <= facet_sag_mm(mold)


def test_plates_volume_is_what_the_cavities_lack() -> None:
    mold = stack("honeycomb")
    plain = Slab(mold.edges(1)[0], 0.0, mold.thickness_mm[1], outer_top=mold.edges(1)[1])
    missing = volume_mm3(make_slab_solid(plain)) - volume_mm3(black_layer("honeycomb"))
    standing = 0.0
    for color in ("red", "green", "blue", "white"):
        slab = parts("honeycomb")[f"boss-{color}"].slab
        assert slab is not None
        bare = Slab(slab.outer, slab.bottom_mm, slab.top_mm, slab.through)
        standing += volume_mm3(parts("honeycomb")[f"boss-{color}"].solid) - volume_mm3(make_slab_solid(bare))
    assert missing == pytest.approx(standing, rel=1e-9)
