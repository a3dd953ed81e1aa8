"""Molds: every solid against its closed form, refused designs, clearances, and the files."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cmpdesign import build_layout, load
from cmpdesign.errors import DesignError
from cmpdesign.products.mold import make, pad, processes
from cmpdesign.products.mold.checks.findings import check_mold, require_no_errors
from cmpdesign.products.mold.meshes import prepare_meshes
from cmpdesign.products.mold.parts import Part, make_parts
from cmpdesign.products.mold.shapes import caps
from cmpdesign.products.mold.shapes.cavities import cavities, seen_inset_mm
from cmpdesign.products.mold.solids import slab_shells as shells
from cmpdesign.products.mold.solids.loops import (
    Loop,
    circle_loop,
    frustum_volume_mm3,
    polygon_loop,
    rounded_polygon,
)
from cmpdesign.products.mold.solids.measure import drafts_deg, measure_solid, subshapes
from cmpdesign.products.mold.solids.slab_shells import Feature, Slab, make_slab_solid, slab_volume_mm3
from cmpdesign.products.mold.solids.tiled_faces import tile_faces
from cmpdesign.products.mold.stack.stack import MoldStack, make_stack
from cmpdesign.products.mold.step.step import NamedSolid, read_step, solid_to_step
from cmpdesign.products.registry import Maker

DESIGNS = {
    "honeycomb": {"layers": "3"},
    "round, turned": {"layers": "4", "rotation_deg": "11", "pattern": "round"},
    "elliptical": {"layers": "3", "pattern": "elliptical", "aspect": "0.6"},
    "square": {"layers": "2", "pattern": "square"},
    "clipped": {"layers": "4", "clip": "circle", "clip_diameter_mm": "11"},
    "sharp": {"layers": "2", "mold.tip_radius_mm": "0", "mold.draft_deg": "0"},
    "sphere": {"layers": "3", "mold.crown": "sphere", "mold.crown_radius_mm": "12"},
    "cylinder": {
        "layers": "3", "mold.crown": "cylinder", "mold.crown_radius_mm": "12", "mold.projection": "vertical"
    },
    "shrinking": {"layers": "2", "mold.marker_silicone": "sylgard-184"},
}  # fmt: skip


def stack(**values: str) -> MoldStack:
    design = load("honeycomb", values)
    return make_stack(design, build_layout(design))


def parts(**values: str) -> dict[str, Part]:
    return {part.name: part for part in make_parts(stack(**values))}


@pytest.mark.parametrize("name", DESIGNS)
def test_every_solid_is_valid_closed_and_of_its_volume(name: str) -> None:
    for part in parts(**DESIGNS[name]).values():
        found = measure_solid(part.solid)
        assert found.valid and found.closed, part.name
        assert found.volume_mm3 == pytest.approx(part.volume_mm3, rel=1e-9), part.name


@pytest.mark.parametrize("name", ["honeycomb", "square", "cylinder"])
def test_solids_read_back_from_step_are_equal(name: str) -> None:
    """Every kind of part: faces, volume, area and centre, and still valid and closed."""
    for kind, part in one_of_each_kind(name).items():
        again = read_step(solid_to_step(NamedSolid(part.name, part.color, part.solid)))
        found, before = measure_solid(again), measure_solid(part.solid)
        assert found.valid and found.closed and found.faces == before.faces, kind
        assert found.volume_mm3 == pytest.approx(part.volume_mm3, rel=1e-9), kind
        for now, then in zip(volume_and_centre(again), volume_and_centre(part.solid), strict=True):
            np.testing.assert_allclose(now, then, rtol=1e-9, atol=1e-8, err_msg=kind)


@pytest.mark.slow
def test_solids_of_a_sphere_read_back_from_step_are_equal() -> None:
    test_solids_read_back_from_step_are_equal("sphere")


def one_of_each_kind(name: str) -> dict[str, Part]:
    found: dict[str, Part] = {}
    for part in parts(**DESIGNS[name]).values():
        found.setdefault(part.name.partition("-")[0], part)
    assert list(found) == ["base", "frame", "boss", "stencil", "cover", "lid", "pin"]
    return found


def test_volume_check_can_fail() -> None:
    part = parts(layers="2")["boss-red"]
    assert part.slab is not None
    lost = Slab(
        part.slab.outer, part.slab.bottom_mm, part.slab.top_mm, part.slab.through, (), part.slab.many[1:]
    )
    assert abs(measure_solid(make_slab_solid(lost)).volume_mm3 / part.volume_mm3 - 1) > 1e-5


@pytest.mark.parametrize(("draft", "lean"), [("2", 2.0), ("5", 5.0), ("0", 0.0)])
def test_draft_is_measured_on_the_faces(draft: str, lean: float) -> None:
    values = {"layers": "2", "mold.draft_deg": draft}
    for name in ("base", "boss-red", "frame", "cover"):
        part = parts(**values)[name]
        # Walls between the white cell and its neighbours stand upright.
        least = 0.0 if name == "boss-red" else lean
        assert drafts_deg(part.solid, *part.pull_box_mm) == pytest.approx((least, lean), abs=1e-6), name
    stencil = parts(**values)["stencil-red"]
    assert drafts_deg(stencil.solid, *stencil.pull_box_mm) == pytest.approx((10, 10), abs=1e-6)


@pytest.mark.parametrize("name", ["square", "shrinking", "sphere", "cylinder"])
def test_every_kind_of_part_has_its_draft(name: str) -> None:
    """Between slanted outlines a wall leans a little more or less than the draft, downhill or uphill."""
    crowned = name in ("sphere", "cylinder")
    for kind, part in one_of_each_kind(name).items():
        low, high = drafts_deg(part.solid, *part.pull_box_mm)
        if kind == "pin":
            continue
        wanted = {"stencil": 10.0, "lid": 5.0}.get(kind, 2.0)
        slack = 0.06 * wanted if crowned and kind in ("boss", "stencil") else 1e-6
        # Beside the white cell of a flat pad, and nowhere else, walls stand upright.
        least = 0.0 if kind == "boss" and name == "shrinking" else wanted
        assert least - slack <= low <= high <= wanted + slack, kind


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "square"])
def test_no_turn_or_flip_of_a_part_fits_the_pins(pattern: str) -> None:
    mold = stack(layers="3", pattern=pattern)
    pins = mold.pins_mm
    half = mold.pin_diameter_mm / 2
    for quarter, flip in itertools.product(range(4), (1, -1)):
        if (quarter, flip) == (0, 1):
            continue
        c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarter]
        turned = pins * (1, flip) @ np.array([(c, s), (-s, c)])
        # The best that sliding can do: the middles of both sets on each other.
        turned += (pins.min(axis=0) + pins.max(axis=0) - turned.min(axis=0) - turned.max(axis=0)) / 2
        misses = np.hypot(*(pins[:, None] - turned[None]).transpose(2, 0, 1)).min(axis=1)
        assert misses.max() > half


def test_pins_are_where_the_laser_has_its_fiducials() -> None:
    """The laser's sheet lies on the pins as it was carved for a pad that is seen from the back, else turned over."""
    for mirrored, sign in (("true", 1.0), ("false", -1.0)):
        design = load("honeycomb", {"layers": "3", "mirrored": mirrored})
        layout = build_layout(design)
        mold = make_stack(design, layout)
        np.testing.assert_array_equal(mold.pins_mm[:3], layout.fiducials_mm * (sign, 1.0))


def test_shrinkage_is_added_as_a_scale() -> None:
    plain, shrinking = stack(layers="2"), stack(layers="2", **{"mold.marker_silicone": "sylgard-184"})
    ratio = (1 - 0.001) / (1 - 0.0106)
    np.testing.assert_allclose(shrinking.marker_xy_mm, plain.marker_xy_mm * ratio, rtol=1e-12)
    assert shrinking.thickness_mm[1] == pytest.approx(0.5 / (1 - 0.0106))
    np.testing.assert_array_equal(shrinking.pins_mm, plain.pins_mm)


def test_equidistant_projection_keeps_lengths_from_the_apex() -> None:
    mold = stack(layers="4", **{"mold.crown": "sphere", "mold.crown_radius_mm": "15"})
    assert mold.crown is not None
    away = np.hypot(*mold.marker_xy_mm.T)
    arc = mold.crown.radius_mm * np.arcsin(away / mold.crown.radius_mm)
    flat = np.hypot(*mold.layout.marker_xy_mm.T) * mold.silicones[1].scale
    np.testing.assert_allclose(arc, flat, atol=1e-9)


SPHERE = {"mold.crown": "sphere"}
IMPOSSIBLE = {
    "gap 0": ({"mold.gap_mm": "0"}, r"mold.gap_mm: 0 mm, limit 0.01 mm; make it larger"),
    "nozzle": ({"pitch_mm": "0.6", "mold.tool": "fdm-pla"}, r"narrowest boss at its tip: .*, limit 0.4 mm"),
    "cutter": ({"mold.minimum_feature_mm": "1"}, r"narrowest boss at its tip: 0.8.* mm, limit 1 mm"),
    "steep": ({**SPHERE, "mold.crown_radius_mm": "3"}, r"crown_radius_mm = 3 mm: .* limit 60 deg"),
    "no radius": (SPHERE, "needs mold.crown_radius_mm"),
    "undercut": ({"mold.draft_deg": "-1"}, "an undercut"),
    "slender": ({"mold.marker_mm": "2.6", "mold.draft_deg": "0"}, "boss height over width"),
    "thin wall": ({"mold.wall_mm": "0.2"}, "mold.wall_mm: 0.2 mm, limit"),
    "tin": ({"mold.base_silicone": "mold-max-30"}, "tin-cured layers .* under a platinum-cured one"),
    "tin on top": ({"mold.cover_silicone": "mold-max-30"}, "platinum-cured layers .* under a tin-cured one"),
    "unknown": ({"mold.base_silicone": "solari"}, "did you mean solaris"),
    "pins": (
        {"layers": "2", "mold.pin_diameter_mm": "4"},
        r"a pin hole and a jack screw's hole in the boss plates: .* mm",
    ),
    "pins at the pad": (
        {"layers": "2", "fiducials.gap_mm": "0"},
        "wall between a pin hole and .*; make .*fiducials.gap_mm",
    ),
    "many vents": (
        {"mold.vents": "64"},
        "wall between a vent and another in the lid.*; make mold.vents fewer",
    ),
    "wide vents": ({"layers": "2", "mold.vent_mm": "3"}, "wall between a vent and another|under its vents"),
    "thin pins": ({"mold.pin_diameter_mm": "0.5"}, "diameter of a pin between its chamfers"),
    "hidden": (
        {"mold.base_silicone": "ecoflex-00-30"},
        "is not clear .*set mold.base_silicone to solaris, sylgard-184",
    ),
    "moat": ({"mold.moat_mm": "6"}, "wall between the moat and a pin hole"),
    "square dome": ({"pattern": "square", **SPHERE, "mold.crown_radius_mm": "20"}, "four are in no plane"),
}


@pytest.mark.parametrize("product", [make.prepare_mold, prepare_meshes])
@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_what_cannot_be_made_is_refused_before_any_solid(
    name: str, product: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    values, message = IMPOSSIBLE[name]
    nothing_is_built(monkeypatch)
    design = load("honeycomb", {"layers": "3", **values})
    with pytest.raises(DesignError, match=message):
        product(design, build_layout(design)).make()


def nothing_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every way to a solid or a mesh fails."""
    ways = (
        (shells.ShellBuilder, "__init__"),
        (caps, "cap_solid"),
        (pad, "frusta_mesh"),
        (processes.subprocess, "Popen"),
    )
    for where, way in ways:
        monkeypatch.setattr(where, way, lambda *_, **__: pytest.fail("geometry was built"))


@pytest.mark.parametrize("product", [make.prepare_mold, prepare_meshes])
def test_building_would_be_seen(product: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing_is_built(monkeypatch)
    design = load("honeycomb", {"layers": "2"})
    with pytest.raises(pytest.fail.Exception, match="geometry was built"):
        product(design, build_layout(design)).make()


def test_resin_that_inhibits_the_cure_is_reported() -> None:
    subjects = [finding.subject for finding in check_mold(stack(layers="2"))]
    assert any("Solaris" in subject and "sla-resin" in subject for subject in subjects)
    assert check_mold(stack(layers="2", **{"mold.tool": "steel"})) == []


def test_a_lid_without_vents_is_warned_of() -> None:
    (finding,) = check_mold(stack(layers="2", **{"mold.tool": "steel", "mold.vents": "0"}))
    assert finding.severity == "warning" and "air stays" in finding.remedy


def test_the_size_of_a_pad_is_stated_at_both_faces() -> None:
    mold = stack(layers="2", **{"mold.draft_deg": "3"})
    sizes = make.mold_figures(mold)["pad_mm"]
    width, height = mold.layout.size_mm
    assert sizes["back"] == pytest.approx([width, height], abs=1e-5)
    # The whole pad, 5 mm high, leans by 3 degrees; the outline is a hexagon with corners to the left and right.
    growth = 2 * 5 * np.tan(np.radians(3))
    assert sizes["cover"] == pytest.approx(
        [width + growth / np.cos(np.radians(30)), height + growth], abs=1e-5
    )


@pytest.mark.parametrize("pattern", ["honeycomb", "round", "elliptical", "square"])
@pytest.mark.parametrize("values", [{}, {"mold.draft_deg": "6"}, {"mold.tip_radius_mm": "0"}])
def test_cavities_leave_the_gap_between_them_at_the_open_side(pattern: str, values: dict[str, str]) -> None:
    mold = stack(layers="3", pattern=pattern, **values)
    rings = [
        cavity.open.with_chords(chord_deg=1.0).points
        for color in mold.colors
        for cavity in cavities(mold, color)
    ]
    cells = [shapely.Polygon(ring) for ring in rings]
    _, distances = shapely.STRtree(cells).query_nearest(cells, exclusive=True, return_distance=True)
    # Beside the white cell corners are chords, which lie up to half a micrometre outside their arcs.
    assert distances.min() >= mold.options.gap_mm - 1e-3
    # No more is taken from the seen cells than this asks for.
    if seen_inset_mm(mold) > 0:
        assert distances.min() <= mold.options.gap_mm + 1e-4


def test_findings_that_warn_do_not_refuse() -> None:
    findings = check_mold(stack(layers="2", **{"mold.draft_deg": "0", "mold.gap_mm": "0.005"}))
    assert {finding.severity for finding in findings} == {"warning"}
    require_no_errors(findings)


loops = st.builds(
    lambda n, size, radius, turn, x, y: rounded_polygon(
        size * np.stack([np.cos(turn + 2 * np.pi * np.arange(n) / n), np.sin(turn + 2 * np.pi * np.arange(n)
        / n)], -1) + (x, y),
        radius * size,
    ),
    st.integers(3, 5), st.floats(0.3, 0.6), st.sampled_from([0.0, 0.1, 0.3]), st.floats(0, 6.3),
    st.floats(-0.1, 0.1), st.floats(-0.1, 0.1),
)  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(shapes=st.lists(loops, min_size=1, max_size=24), columns=st.integers(1, 6), framed=st.booleans())
def test_tiles_cover_any_sheet_exactly(shapes: list[Loop], columns: int, framed: bool) -> None:
    features = [
        loop.shifted(1.5 * (n % columns) + 0.7 * (n // columns % 2), 1.5 * (n // columns))
        for n, loop in enumerate(shapes)
    ]
    outer = polygon_loop(np.array([(-3, -3), (14, -3), (14, 38), (-3, 38.0)]))
    holes = [circle_loop(np.array([12.5, 36.0]), 1.0)] if framed else []
    slab = Slab(
        outer, -1.0, 0.0, [(h, h) for h in holes], (), [Feature(f, f.offset(-0.01), 0.5) for f in features]
    )
    found = measure_solid(make_slab_solid(slab))
    assert found.valid and found.closed
    assert found.volume_mm3 == pytest.approx(slab_volume_mm3(slab), rel=1e-11)


def test_tiles_hold_few_holes_whatever_the_pattern() -> None:
    for pattern in ("honeycomb", "round", "elliptical"):
        mold = stack(layers="12", pattern=pattern, rotation_deg="7")
        roots = [rounded_polygon(cell, 0.01).offset(-0.05) for cell in mold.cells(0)]
        sheet = tile_faces(mold.block, mold.holes(), roots, 0.05)
        assert max(len(wires) for wires in sheet.faces) <= 20, pattern


def test_no_line_crosses_the_arc_at_a_tip_twice() -> None:
    """Tips of the cells of this ellipse lie at many heights."""
    design = load("digit")
    plates = [
        part for part in make_parts(make_stack(design, build_layout(design))) if part.name == "boss-blue"
    ]
    assert measure_solid(plates[0].solid).valid


def test_uprights_stay_within_a_slanted_pad() -> None:
    design = load("square", {"layers": "3", "rotation_deg": "20", "pitch_mm": "2.673", "border_mm": "0.8"})
    for mesh, volume in pad.pad_meshes(make_stack(design, build_layout(design))):
        assert mesh.volume_mm3() == pytest.approx(volume, rel=1e-9), mesh.name


def test_frustum_of_circles() -> None:
    lower, upper = circle_loop(np.zeros(2), 4.0), circle_loop(np.zeros(2), 2.0)
    assert frustum_volume_mm3(lower, upper, 3.0) == pytest.approx(np.pi * 3 * (4 + 2 + 1) / 3, rel=1e-14)


def test_two_processes_make_what_one_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    design = load("honeycomb", {"layers": "1"})
    layout = build_layout(design)
    alone = make.prepare_mold(design, layout).make()
    monkeypatch.setattr(processes, "MIN_BOSSES_FOR_TWO", 0)
    helped: list[object] = []
    process = processes.subprocess.Popen
    monkeypatch.setattr(
        processes.subprocess, "Popen", lambda *args, **more: helped.append(args) or process(*args, **more)
    )
    monkeypatch.setattr(processes, "available_cores", lambda: 2)
    together = make.prepare_mold(design, layout).make()
    assert len(helped) == 2
    assert list(together.files.items()) == list(alone.files.items())
    assert together.figures == alone.figures


def test_a_helper_that_fails_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    design = load("honeycomb", {"layers": "2"})
    monkeypatch.setattr(processes, "MIN_BOSSES_FOR_TWO", 0)
    monkeypatch.setattr(processes, "available_cores", lambda: 2)
    monkeypatch.setattr(processes, "__name__", "cmpdesign.mold.absent")
    with pytest.raises(RuntimeError, match=r"(?s)a process failed: .*No module named"):
        make.prepare_mold(design, build_layout(design)).make()


def test_assembly_holds_every_part_where_it_is_used() -> None:
    design = load("honeycomb", {"layers": "2"})
    layout = build_layout(design)
    content = make.prepare_mold(design, layout).make().files["mold/assembly.step"]
    assert isinstance(content, bytes)
    numbers = [int(n) for n in re.findall(rb"^#(\d+) = ", content, flags=re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert {int(n) for n in re.findall(rb"#(\d+)", content)} == set(numbers)
    mold = make_stack(design, layout)
    described = make_parts(mold)
    by_name = {part.name: part for part in described}
    places = [p for group in make.make_assembly(mold, described).groups for p in group.places]
    found = solids_of(read_step(content))
    assert len(found) == len(places)
    for solid, place in zip(found, places, strict=True):
        volume, centre = volume_and_centre(solid)
        own_volume, own_centre = volume_and_centre(by_name[place.part].solid)
        turn = np.array([1, -1, -1]) if place.turned else np.ones(3)
        assert volume == pytest.approx(own_volume, rel=1e-9), place.name
        np.testing.assert_allclose(centre, own_centre * turn + place.xyz_mm, atol=1e-8, err_msg=place.name)


def solids_of(shape: object) -> list[object]:
    from OCP.TopAbs import TopAbs_ShapeEnum

    return subshapes(shape, TopAbs_ShapeEnum.TopAbs_SOLID)


def volume_and_centre(shape: object) -> tuple[float, np.ndarray]:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    centre = properties.CentreOfMass()
    return properties.Mass(), np.array([centre.X(), centre.Y(), centre.Z()])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_build123d_reads_names_colors_and_places(tmp_path: Path) -> None:
    from build123d import import_step

    design = load("honeycomb", {"layers": "2"})
    files = make.prepare_mold(design, build_layout(design)).make().files
    for name in ("boss-red", "assembly"):
        content = files[f"mold/{name}.step"]
        assert isinstance(content, bytes)
        (tmp_path / f"{name}.step").write_bytes(content)
    plate = import_step(tmp_path / "boss-red.step")
    assert plate.label == "boss-red" and plate.is_valid
    assert tuple(plate.color)[:3] != (0, 0, 0)
    assembly = import_step(tmp_path / "assembly.step")
    assert [child.label for child in assembly.children][:2] == ["1-base", "2-emboss-red"]
    assert [part.label for part in assembly.children[0].children][:2] == ["base", "lid"]
