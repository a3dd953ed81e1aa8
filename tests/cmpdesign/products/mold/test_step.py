"""STEP files as text: the rules of a solid's boundary, read without the kernel; and the checks that need the kernel."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import pytest

from cmpdesign import build_layout, load
from cmpdesign.products.mold.parts import make_parts
from cmpdesign.products.mold.solids.measure import measure_solid, volume_mm3
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.mold.step.entities import format_real
from cmpdesign.products.mold.step.step import NamedSolid, read_step, solid_to_step

CROWNS = ("flat", "sphere", "cylinder")


def solids(crown: str) -> dict[str, Any]:
    values = {"mold.crown": crown, "mold.crown_radius_mm": "12"} if crown != "flat" else {}
    design = load("honeycomb", {"layers": "2", **values})
    return {part.name: part.solid for part in make_parts(make_stack(design, build_layout(design)))}


def entities(file: bytes) -> dict[int, tuple[str, str]]:
    """Number -> (kind, arguments) of a file's simple entities."""
    text = file.decode("ascii").replace("\n", "")
    found = re.findall(r"#(\d+) = ([A-Z0-9_]+)\((.*?)\);", text)
    return {int(number): (kind, rest) for number, kind, rest in found}


def of_kind(file: dict[int, tuple[str, str]], kind: str) -> dict[int, str]:
    return {number: rest for number, (found, rest) in file.items() if found == kind}


def refers(rest: str) -> list[int]:
    return [int(number) for number in re.findall(r"#(\d+)", rest)]


@pytest.mark.parametrize("crown", CROWNS)
def test_every_shell_is_closed_in_the_text(crown: str) -> None:
    """Every edge is run once each way, and every loop's edges begin where the last one ended."""
    for name, solid in solids(crown).items():
        file = entities(solid_to_step(NamedSolid(name, "#808080", solid)))
        ends = {number: refers(rest)[:2] for number, rest in of_kind(file, "EDGE_CURVE").items()}
        steps = {
            n: (refers(rest)[0], rest.endswith(".T.")) for n, rest in of_kind(file, "ORIENTED_EDGE").items()
        }
        loops = {
            number: [steps[step] for step in refers(rest)]
            for number, rest in of_kind(file, "EDGE_LOOP").items()
        }
        for loop in loops.values():
            run = [ends[edge] if along else ends[edge][::-1] for edge, along in loop]
            assert all(run[i - 1][1] == run[i][0] for i in range(len(run))), name
        used: Counter[tuple[int, bool]] = Counter()
        for rest in of_kind(file, "FACE_BOUND").values():
            outward = rest.endswith(".T.")
            used.update((edge, along == outward) for edge, along in loops[refers(rest)[0]])
        assert set(used.values()) == {1}, name
        assert set(used) == {(edge, along) for edge in ends for along in (True, False)}, name
        places = [refers(rest)[0] for rest in of_kind(file, "VERTEX_POINT").values()]
        assert len(places) == len(set(places)), name


def test_geometry_that_many_use_is_written_once() -> None:
    file = entities(solid_to_step(NamedSolid("plate", "#808080", solids("flat")["boss-red"])))
    for kind in ("CARTESIAN_POINT", "DIRECTION", "VECTOR"):
        texts = list(of_kind(file, kind).values())
        assert len(texts) == len(set(texts)), kind


def ball_with(change: str) -> Any:
    """A bored ball, moved, mirrored or both: the axes of its cone and sphere may then be left-handed."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location

    bore = BRepPrimAPI_MakeCone(gp_Ax2(gp_Pnt(0, 0, -3), gp_Dir(0, 0, 1)), 1.2, 0.8, 6.0).Shape()
    shape = BRepAlgoAPI_Cut(BRepPrimAPI_MakeSphere(2.0).Shape(), bore).Shape()
    if "mirrored" in change:
        mirror = gp_Trsf()
        mirror.SetMirror(gp_Ax2(gp_Pnt(0.1, 0.2, 0.3), gp_Dir(1, 2, 2)))
        shape = BRepBuilderAPI_Transform(shape, mirror, True).Shape()
    if "moved" in change:
        move = gp_Trsf()
        move.SetTranslation(gp_Vec(10, 20, 30))
        shape = shape.Moved(TopLoc_Location(move))
    return TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID).Current()


@pytest.mark.parametrize("change", ["as it is", "mirrored", "moved", "mirrored and moved"])
def test_solids_that_were_moved_or_mirrored_are_read_back(change: str) -> None:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    def centre(shape: Any) -> tuple[float, float, float]:
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(shape, properties)
        point = properties.CentreOfMass()
        return point.X(), point.Y(), point.Z()

    solid = ball_with(change)
    again = read_step(solid_to_step(NamedSolid("ball", "#808080", solid)))
    found = measure_solid(again)
    assert found.valid and found.closed and found.volume_mm3 > 0
    assert found.volume_mm3 == pytest.approx(volume_mm3(solid), rel=1e-7)
    assert centre(again) == pytest.approx(centre(solid), abs=1e-7)


@pytest.mark.parametrize("change", ["as it is", "mirrored"])
def test_faces_know_which_side_of_their_surface_is_outside(change: str) -> None:
    """A file's spheres and cones have their normal outward: that is the ball's outside and the bore's inside."""
    file = entities(solid_to_step(NamedSolid("ball", "#808080", ball_with(change))))
    senses = {file[refers(rest)[-1]][0]: rest[-3:] for rest in of_kind(file, "ADVANCED_FACE").values()}
    assert senses == {"SPHERICAL_SURFACE": ".T.", "CONICAL_SURFACE": ".F."}


def test_what_cannot_be_written_is_refused() -> None:
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere, BRepPrimAPI_MakeTorus
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    with pytest.raises(RuntimeError, match="a face is a Geom_ToroidalSurface, no plane"):
        solid_to_step(NamedSolid("ring", "#808080", BRepPrimAPI_MakeTorus(3.0, 1.0).Solid()))
    shell = BRepAlgoAPI_Cut(BRepPrimAPI_MakeSphere(2.0).Shape(), BRepPrimAPI_MakeSphere(1.0).Shape()).Shape()
    hollow = TopExp_Explorer(shell, TopAbs_ShapeEnum.TopAbs_SOLID).Current()
    with pytest.raises(RuntimeError, match="2 shells, not one"):
        solid_to_step(NamedSolid("hollow", "#808080", hollow))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0."),
        (-0.0, "0."),
        (1.0, "1."),
        (-2.5, "-2.5"),
        (1e-7, "1.E-07"),
        (1.5e-17, "1.5E-17"),
        (1e15, "1.E+15"),
    ],
)
def test_reals_always_have_a_point(value: float, text: str) -> None:
    assert format_real(value) == text
