"""Meshes of molds and pads: closed, of their volume, and read back by other readers."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pypdfium2
import pytest
import trimesh

from cmpdesign import build_layout, load
from cmpdesign.design.templates import templates_folder
from cmpdesign.products.mesh.picture import ABOVE, BELOW, PictureDirection, draw_meshes
from cmpdesign.products.mesh.three_mf import meshes_to_3mf, read_3mf
from cmpdesign.products.mesh.triangle_mesh import TriangleMesh
from cmpdesign.products.mold import meshes as product
from cmpdesign.products.mold.finish import MoldError
from cmpdesign.products.mold.job_sheet import bill_of_materials, process_sheet, weighings
from cmpdesign.products.mold.meshes import make_part_mesh, prepare_meshes
from cmpdesign.products.mold.pad import pad_meshes
from cmpdesign.products.mold.parts import make_parts
from cmpdesign.products.mold.pictures import exploded_meshes
from cmpdesign.products.mold.stack.stack import make_stack
from cmpdesign.products.process_sheet.html import sheet_to_html
from cmpdesign.products.registry import ProductFiles

HONEYCOMB = load("honeycomb", {"layers": "2"})


@pytest.fixture(scope="module")
def made() -> ProductFiles:
    return prepare_meshes(HONEYCOMB, build_layout(HONEYCOMB)).make()


def content(made: ProductFiles, name: str) -> bytes:
    data = made.files[f"mesh/{name}"]
    assert isinstance(data, bytes)
    return data


def trimesh_of(data: bytes, kind: str) -> Mapping[str, object]:
    scene = trimesh.load(io.BytesIO(data), file_type=kind)
    return dict(scene.geometry) if isinstance(scene, trimesh.Scene) else {"mesh": scene}


def test_every_stl_is_watertight_and_of_its_volume(made: ProductFiles) -> None:
    names = [name.removeprefix("mesh/") for name in made.files if name.endswith(".stl")]
    assert len(names) == 13 + 7
    for name in names:
        (body,) = trimesh_of(content(made, name), "stl").values()
        assert body.is_watertight and body.is_winding_consistent, name  # type: ignore[attr-defined]
        figures = made.figures[name.replace("-", "/", 1).removesuffix(".stl")]
        assert body.volume == pytest.approx(figures["volume_mm3"], rel=1e-4), name  # type: ignore[attr-defined]


def test_volumes_are_the_analytic_ones(made: ProductFiles) -> None:
    for name, figures in made.figures.items():
        tolerance = 5e-3 if name == "mold/pin" else 1e-7
        assert figures["volume_mm3"] == pytest.approx(figures["analytic_mm3"], rel=tolerance), name


def test_layers_fill_the_pad_without_gap_or_overlap() -> None:
    design = load("round", {"layers": "3"})
    stack = make_stack(design, build_layout(design))
    volumes = {mesh.name: mesh.volume_mm3() for mesh, _ in pad_meshes(stack)}
    middle = sum(volumes[name] for name in ("black", "red", "green", "blue", "white"))
    outline = stack.layout.outline_mm
    from cmpdesign.products.mold.solids.loops import frustum_volume_mm3, polygon_loop

    edge = polygon_loop(outline).offset(stack.lean * 4.0)
    assert middle == pytest.approx(frustum_volume_mm3(edge, edge.offset(stack.lean * 0.5), 0.5), rel=1e-9)


def test_glb_is_in_metres_and_named(made: ProductFiles) -> None:
    bodies = trimesh_of(content(made, "pad.glb"), "glb")
    assert set(bodies) == {"base", "black", "red", "green", "blue", "white", "cover"}
    height = max(float(body.bounds[1][1]) for body in bodies.values())  # type: ignore[attr-defined]
    assert height == pytest.approx(0.005, rel=1e-6)


def test_a_pad_as_3mf_is_one_object_and_a_mold_one_for_each_part(made: ProductFiles) -> None:
    """A slicer would put several objects beside each other, each on the plate."""
    (pad,) = read_3mf(content(made, "pad.3mf"))
    assert pad.materials == ["base", "black", "red", "green", "blue", "white", "cover"]
    assert (pad.high_mm - pad.low_mm)[2] == pytest.approx(5.0, abs=1e-5)
    mold = read_3mf(content(made, "mold.3mf"))
    assert len(mold) == 13 and {len(part.materials) for part in mold} == {1}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("prusa-slicer") is None, reason="needs PrusaSlicer")
def test_a_slicer_keeps_the_pad_in_one_piece(made: ProductFiles, tmp_path: Path) -> None:
    """PrusaSlicer's own measure of the one object that it would slice, and the parts that it knows of it."""
    (tmp_path / "pad.3mf").write_bytes(content(made, "pad.3mf"))
    command = ["prusa-slicer", "--info", str(tmp_path / "pad.3mf")]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    (height_mm,) = re.findall(r"size_z = ([\d.]+)", told)
    assert float(height_mm) == pytest.approx(5.0, abs=1e-3)
    command = ["prusa-slicer", "--export-3mf", "-o", str(tmp_path / "again.3mf"), str(tmp_path / "pad.3mf")]
    subprocess.run(command, capture_output=True, check=True)
    with zipfile.ZipFile(tmp_path / "again.3mf") as again:
        parts = again.read("Metadata/Slic3r_PE_model.config").decode()
    names = re.findall(r'type="volume" key="name" value="(\w+)"', parts)
    assert names == ["base", "black", "red", "green", "blue", "white", "cover"]
    assert re.findall(r'key="extruder" value="(\d)"', parts) == list("1234567")


def test_an_open_mesh_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)])
    tent = TriangleMesh("tent", "#ff0000", points, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3)]))
    with pytest.raises(RuntimeError, match="tent: the mesh is not closed"):
        meshes_to_3mf([tent], "tent", is_one_piece=True)
    monkeypatch.setattr(product, "pad_meshes", lambda stack: [(tent, tent.volume_mm3())])
    design = load("honeycomb", {"layers": "1"})
    with pytest.raises(MoldError, match="tent: watertight False"):
        prepare_meshes(design, build_layout(design)).make()


@pytest.mark.parametrize("crown", [pytest.param("sphere", marks=pytest.mark.slow), "cylinder"])
def test_crowned_meshes_are_closed(crown: str) -> None:
    design = load("honeycomb", {"layers": "2", "mold.crown": crown, "mold.crown_radius_mm": "15"})
    stack = make_stack(design, build_layout(design))
    made = [(mesh, volume, 1e-9) for mesh, volume in pad_meshes(stack)]
    for mesh, volume, tolerance in made + [make_part_mesh(part) for part in make_parts(stack)]:
        body = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
        assert body.is_watertight and body.is_winding_consistent, mesh.name
        assert mesh.volume_mm3() == pytest.approx(volume, rel=tolerance), mesh.name


def test_the_job_sheet_of_a_dome_says_nothing_of_flush() -> None:
    design = load("honeycomb", {"layers": "2", "mold.crown": "sphere", "mold.crown_radius_mm": "15"})
    stack = make_stack(design, build_layout(design))
    page = sheet_to_html(process_sheet("dome", stack, make_parts(stack), []), "pictures")
    assert "flush" not in page and "Wipe along the dome" in page


def test_pictures_show_bosses_from_above_only() -> None:
    design = load("honeycomb", {"layers": "2"})
    plate = next(
        part for part in make_parts(make_stack(design, build_layout(design))) if part.name == "boss-red"
    )
    mesh = make_part_mesh(plate)[0]
    above, below = (draw_meshes([mesh], view, (160, 120)) for view in (ABOVE, BELOW))
    assert above.shape == (120, 160, 3)
    # The middle of the back is plain; bosses throw lines and shades.
    spread = [np.ptp(picture[50:70, 70:90, 2].astype(int)) for picture in (above, below)]
    assert spread[0] > 30 and spread[1] == 0


def test_every_part_has_its_pictures(made: ProductFiles) -> None:
    parts = {name.removeprefix("mold/") for name in made.figures if name.startswith("mold/")}
    assert set(made.pictures) == {"exploded"} | {f"{p}-{side}" for p in parts for side in ("above", "below")}
    for name, picture in made.pictures.items():
        data = content(made, f"pictures/{name}.png")
        np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), 1), picture)
        # A part fills its picture, and does not touch the picture's rim.
        ink = (picture < 250).any(axis=2)
        assert 0.02 < ink.mean() < 0.9 and not ink[[0, -1]].any() and not ink[:, [0, -1]].any(), name


def test_exploded_parts_lie_above_each_other_and_apart() -> None:
    design = load("honeycomb", {"layers": "2"})
    parts = make_parts(make_stack(design, build_layout(design)))
    groups = exploded_meshes(parts, [make_part_mesh(part)[0] for part in parts])
    assert list(groups)[:3] == ["base", "pin", "frame"] and len(groups["pin"]) == 4
    ends = [
        (min(m.points[:, 2].min() for m in g), max(m.points[:, 2].max() for m in g)) for g in groups.values()
    ]
    assert all(below[1] + 2 < above[0] for below, above in pairwise(ends))
    # A boss plate is used upside down: below are its bosses' tips only.
    x, _, z = groups["boss-red"][0].points.T
    assert np.ptp(x[z < z.min() + 1e-6]) < 0.5 * np.ptp(x[z > z.max() - 1e-6])


def test_job_sheet_says_how_much_to_mix(made: ProductFiles) -> None:
    page = made.files["mesh/job-sheet.html"]
    assert isinstance(page, str)
    for word in ("boss-red", "Solaris", "exploded.png", "Draw it off flush"):
        assert word in page
    shown = re.findall(r'src="(.*?)"', page)
    assert "pictures/lid-below.png" in shown and {f"mesh/{name}" for name in shown} <= set(made.files)


def test_masses_are_those_of_the_pad_s_meshes(made: ProductFiles) -> None:
    """The volumes of the STL files, times the density that the silicone's file states; shrinkage is below 0.4 %."""
    stack = make_stack(HONEYCOMB, build_layout(HONEYCOMB))
    for mix in weighings(stack):
        (body,) = trimesh_of(content(made, f"pad-{mix.name}.stl"), "stl").values()
        grams = body.volume * mix.silicone.density_g_cm3.value / 1000  # type: ignore[attr-defined]
        assert mix.cast_g == pytest.approx(grams, rel=4e-3), mix.name


def test_shares_and_losses_are_those_of_the_silicone_s_file(tmp_path: Path) -> None:
    """A large pad, so that no least mass counts."""
    text = (templates_folder() / "silicones" / "dragon-skin-10.toml").read_text(encoding="utf-8")
    changes = {
        "parts_a_b = { value = [1, 1]": "parts_a_b = { value = [10, 1]",
        "pigment_percent = { value = 2": "pigment_percent = { value = 5",
        "loss_percent = { value = 30": "loss_percent = { value = 50",
    }
    for before, after in changes.items():
        assert text.count(before) == 1
        text = text.replace(before, after)
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    design = load(
        "honeycomb", {"layers": 20, "pitch_mm": "20mm", "mold.marker_silicone": str(tmp_path / "mine.toml")}
    )
    stack = make_stack(design, build_layout(design))
    mixes = {mix.name: mix for mix in weighings(stack)}
    red, black, base = mixes["red"], mixes["black"], mixes["base"]
    assert red.a_g / red.b_g == pytest.approx(10) and red.pigment_g / (red.a_g + red.b_g) == pytest.approx(
        0.05
    )
    assert red.mix_g == pytest.approx(1.5 * red.cast_g) and red.retarder_g == 0
    assert black.retarder_g / (black.a_g + black.b_g) == pytest.approx(0.01)
    assert base.pigment_g == 0  # the camera looks through it
    listed = {one.item: one.amount for one in bill_of_materials(stack, make_parts(stack))}
    assert listed["pigment paste, red"] == pytest.approx(red.pigment_g)
    name = red.silicone.name
    total = sum(mix.a_g for mix in mixes.values() if mix.silicone.name == name and mix.name != "cover")
    assert listed[f"{name}, part A"] == pytest.approx(total + (mixes["cover"].a_g), rel=1e-9)


def test_nothing_is_too_little_to_weigh() -> None:
    """The white cell alone would be a tenth of a milligram."""
    for mix in weighings(make_stack(HONEYCOMB, build_layout(HONEYCOMB))):
        assert min(mix.a_g, mix.b_g) >= 1 - 1e-9
        added = (mix.pigment_g, mix.retarder_g, mix.thickener_g)
        assert min([mass for mass in added if mass], default=1) >= 0.1 - 1e-9


def test_the_sheet_as_pdf_has_one_page_a_step(made: ProductFiles) -> None:
    page = made.files["mesh/job-sheet.html"]
    assert isinstance(page, str)
    titles = re.findall(r"<h2>(.*?)</h2>", page)
    document = pypdfium2.PdfDocument(content(made, "job-sheet.pdf"))
    assert len(document) == len(titles) == 11
    for title, one in zip(titles, document, strict=True):
        said = one.get_textpage().get_text_range()
        assert title in said and "* assumed" in said
    drop = document[1].get_textpage().get_text_range()
    assert "layers that may not cure on sla-resin" in drop.replace("\r\n", " ")


def test_a_cure_that_the_parts_do_not_stand_is_marked() -> None:
    design = load("honeycomb", {"layers": 2, "mold.tool": "fdm-pla"})
    stack = make_stack(design, build_layout(design))
    sheet = process_sheet("pla", stack, make_parts(stack), [])
    notes = {
        row[0]: row[2]
        for step in sheet.steps
        for table in step.tables
        for row in table.rows[:2]
        if len(row) == 3
    }
    assert "yields above 50" in notes["60 °C"] and notes["23 °C"] == ""


@pytest.mark.parametrize("run", [1.0, 5.0, 20.0])
def test_a_steep_face_is_drawn_in_its_shade_not_as_an_outline(run: float) -> None:
    """Its depth changes by ``run`` pixels from one pixel to the next."""
    corners = np.array([(0, 0, 0), (0, 10, 0), (-10 * run, 10, 10), (-10 * run, 0, 10)], dtype=float)
    face = TriangleMesh("face", "#ffffff", corners, np.array([(0, 1, 2), (0, 2, 3)]))
    picture = draw_meshes([face], PictureDirection(0.0, 0.0), (100, 100)).astype(float)
    inside = picture[10:90, 10:90, 0]
    assert np.ptp(inside) == 0
    # An edge before something far behind it is still outlined.
    assert picture[:, 50, 0].min() < 0.75 * inside.min()
