"""Every format has exactly the paths of the job, read by other libraries."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pygcode
import pytest
import svgelements

from cmpdesign.cli import app
from cmpdesign.products.laser.formats.drawing import LaserDrawing, job_drawing
from cmpdesign.products.laser.formats.dxf import drawing_to_dxf
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.formats.lightburn import drawing_to_lightburn
from cmpdesign.products.laser.formats.svg import drawing_to_svg
from cmpdesign.products.laser.job import LaserJob
from tests.support.laser_tools import Points, groups_of, made_job, run_gcode

WITH_OUTLINE = {"laser__outline": "true", "laser__passes": "2"}
CASES = [
    ("honeycomb", WITH_OUTLINE),
    ("square", {}),
    ("round", {"laser__corner": "plain", "laser__order": "heat"}),
]
SVG = "{http://www.w3.org/2000/svg}"


@cache
def drawn(number: int) -> tuple[LaserJob, LaserDrawing]:
    name, options = CASES[number]
    job = made_job(name, **options)
    return job, job_drawing(job)


def same_paths(found: list[Points], drawing: LaserDrawing, name: str) -> None:
    """The same points in the same order, to a tenth of a micrometre."""
    expected = [path for one in drawing.passes if one.name == name for path in one.walls]
    assert len(found) == len(expected) > 0
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, atol=1.01e-4)


@pytest.mark.parametrize("case", range(len(CASES)))
def test_svg(case: int) -> None:
    job, drawing = drawn(case)
    text = drawing_to_svg(drawing)
    root = ElementTree.fromstring(text)
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("300mm", "200mm", "0 0 300 200")
    assert "transform" not in text and "<text" not in text
    read = svgelements.SVG.parse(io.StringIO(text), ppi=25.4)
    for one in job.passes:
        (group,) = root.iterfind(f"{SVG}g[@id='{one.name}']")
        assert group.get("fill") == "none"
        paths = [svgelements.Path(element.get("d", "")) for element in group]
        assert all(isinstance(path[-1], svgelements.Close) for path in paths)
        points = [np.array([(seg.end.x, 200 - seg.end.y) for seg in path[:-1]]) for path in paths]
        same_paths(points, drawing, one.name)
    left, top, right, bottom = read.bbox()
    inside = np.array([left, 200 - bottom, right, 200 - top])
    walls = np.concatenate([one.walls.xy_mm for one in job.passes])
    np.testing.assert_allclose(inside, [*walls.min(axis=0), *walls.max(axis=0)], atol=1e-3)


def test_svg_colors_are_lightburns() -> None:
    text = drawing_to_svg(drawn(0)[1])
    colors = {"0-holes": "FF8000", "1-red": "FF0000", "2-green": "00E000", "3-blue": "0000FF"}
    colors |= {"4-white": "D0D000", "5-outline": "000000"}
    assert dict(re.findall(r'<g id="([^"]+)" fill="none" stroke="#([0-9A-F]{6})"', text)) == colors


def test_every_path_of_an_svg_has_its_color() -> None:
    """As K40 Whisperer reads it: the color of each path, not that of its group."""
    job, drawing = drawn(0)
    root = ElementTree.fromstring(drawing_to_svg(drawing))
    for one in job.passes:
        (group,) = root.iterfind(f"{SVG}g[@id='{one.name}']")
        assert len(group) and {path.get("stroke") for path in group} == {group.get("stroke")}


@pytest.mark.parametrize("case", range(len(CASES)))
def test_dxf(case: int) -> None:
    job, drawing = drawn(case)
    document = ezdxf.read(io.StringIO(drawing_to_dxf(drawing)))  # type: ignore[attr-defined]
    audit = document.audit()
    assert not audit.errors and not audit.fixes
    assert document.dxfversion == "AC1024"
    assert (document.header["$INSUNITS"], document.header["$MEASUREMENT"]) == (4, 1)
    space = document.modelspace()
    points: list[Points] = []
    for one in job.passes:
        lines = space.query(f'LWPOLYLINE[layer=="{one.name}"]').entities
        assert all(line.closed for line in lines)
        found = [np.array(line.get_points("xy")) for line in lines]
        same_paths(found, drawing, one.name)
        points += found
        layer = document.layers.get(one.name)
        assert layer.dxf.true_color == drawing.laser_layers[one.name].rgb
        assert layer.dxf.color == drawing.laser_layers[one.name].aci
    circles = space.query("CIRCLE").entities
    assert len(circles) == 3 and all(circle.dxf.layer == "T1" for circle in circles)
    from ezdxf import bbox

    box = bbox.extents(space, fast=False)
    np.testing.assert_allclose(document.header["$EXTMIN"], box.extmin, atol=1e-6)
    np.testing.assert_allclose(document.header["$EXTMAX"], box.extmax, atol=1e-6)


def lightburn_paths(root: ElementTree.Element, index: int) -> list[Points]:
    """Path shapes as LightBurn reads them: vertices, then "LineClosed"; affine XForm."""
    found = []
    for shape in root.iterfind(f"Shape[@Type='Path'][@CutIndex='{index}']"):
        assert shape.findtext("PrimList") == "LineClosed"
        vertices = re.findall(r"V(-?[\d.]+) (-?[\d.]+)c0x1c1x1", shape.findtext("VertList") or "")
        assert "".join(f"V{x} {y}c0x1c1x1" for x, y in vertices) == shape.findtext("VertList")
        a, b, c, d, e, f = map(float, (shape.findtext("XForm") or "").split())
        xy = np.array(vertices, dtype=float)
        found.append(xy @ np.array([[a, b], [c, d]]) + (e, f))
    return found


@pytest.mark.parametrize("case", range(len(CASES)))
def test_lightburn(case: int) -> None:
    job, drawing = drawn(case)
    root = ElementTree.fromstring(drawing_to_lightburn(drawing))
    assert root.tag == "LightBurnProject" and root.get("MirrorX") == root.get("MirrorY") == "False"
    # type: ignore[union-attr]
    settings = {item.find("name").get("Value"): item for item in root.iterfind("CutSetting")}
    assert settings.pop("T1").get("type") == "Tool"
    assert list(settings) == [one.name for one in job.passes]
    indices = set()
    for place, one in enumerate(job.passes):
        value = {child.tag: child.get("Value") for child in settings[one.name]}
        assert (value["priority"], value["numPasses"]) == (str(place), str(one.repeats))
        assert float(value["speed"] or 0) == one.speed_mm_s
        assert float(value["maxPower"] or 0) == float(value["minPower"] or 0) == one.power_percent
        indices.add(value["index"])
        same_paths(lightburn_paths(root, int(value["index"] or -1)), drawing, one.name)
    assert len(indices) == len(job.passes)
    numbers = [shape.get("VertID") for shape in root.iterfind("Shape[@Type='Path']")]
    assert len(set(numbers)) == len(numbers)
    marks = root.findall("Shape[@Type='Ellipse'][@CutIndex='30']")
    places = np.array([(mark.findtext("XForm") or "").split()[4:] for mark in marks], dtype=float)
    np.testing.assert_allclose(places, job.fiducials_mm, atol=1e-4)


def test_lightburn_fills_a_hatched_pocket() -> None:
    job = made_job(
        laser__mode="pocket", laser__hatch_mm="0.04", laser__hatch_deg="15", laser__hatch_turn_deg="60"
    )
    root = ElementTree.fromstring(drawing_to_lightburn(job_drawing(job)))
    # type: ignore[union-attr]
    settings = {item.find("name").get("Value"): item for item in root.iterfind("CutSetting")}
    assert settings["1-red"].get("type") == "Scan+Cut" and settings["0-holes"].get("type") == "Cut"
    value = {child.tag: child.get("Value") for child in settings["1-red"]}
    assert (value["interval"], value["angle"], value["anglePerPass"]) == ("0.04", "15", "60")


@pytest.mark.parametrize("case", range(len(CASES)))
def test_gcode_burns_the_paths(case: int) -> None:
    job, drawing = drawn(case)
    for one in job.passes:
        text = drawing_to_gcode(drawing.with_one_pass(one))
        burn = run_gcode(text)
        assert burn.ended_dark and not burn.pauses
        assert burn.feeds == {60 * one.speed_mm_s}
        assert {s for *_, s in burn.burnt} == {10 * one.power_percent}
        strokes = groups_of(burn)
        assert len(strokes) == one.repeats * len(one.walls)
        for stroke, path in zip(strokes[: len(one.walls)], one.walls, strict=True):
            np.testing.assert_allclose(stroke[:, :2], path, atol=1e-9)
            np.testing.assert_allclose(stroke[-1, 2:], path[0], atol=1e-9)
        places = np.concatenate([np.array(burn.dark)[:, 2:], burn.segments[:, 2:]])
        assert (places >= 0).all() and (places <= (300, 200)).all()


def test_gcode_waits_for_filling_between_passes() -> None:
    job, drawing = drawn(0)
    text = drawing_to_gcode(drawing)
    burn = run_gcode(text)
    counts = np.cumsum([one.repeats * len(one.walls.xy_mm) for one in job.passes])
    assert burn.pauses == counts[:-1].tolist()
    waits = [line for line in text.splitlines() if line.startswith("M0")]
    assert "put the pins into the holes" in waits[0] and all("fill, cure" in line for line in waits[1:])
    head = text.splitlines()[:9]
    assert {"G21", "G90", "G94", "M5"} <= set(head)
    assert text.rstrip().endswith("M5\nG0 X0 Y0 S0\nM2")
    for line in text.splitlines():
        assert not line.startswith("G0") or "S0" in line


def test_gcode_of_a_pocket_turns_its_lines() -> None:
    job = made_job(laser__mode="pocket", laser__passes="3", laser__hatch_turn_deg="60", layers="2")
    burn = run_gcode(drawing_to_gcode(job_drawing(job).with_one_pass(job.passes[1])))
    lines = [stroke for stroke in groups_of(burn) if len(stroke) == 1]
    angles = {
        round(np.degrees(np.arctan2(y1 - y0, x1 - x0)) % 180) % 180
        for ((x0, y0, x1, y1),) in lines
        if np.hypot(x1 - x0, y1 - y0) > 0.2
    }
    assert angles == {0, 60, 120}


def test_pygcode_reads_it() -> None:
    """Another interpreter agrees on every place."""
    job, drawing = drawn(0)
    text = drawing_to_gcode(drawing.with_one_pass(job.passes[-2]))
    places = []
    for line in text.splitlines():
        for code in pygcode.Line(line).block.gcodes:
            if code.word_letter == "G" and hasattr(code, "X") and code.X is not None:
                places.append((float(code.X), float(code.Y)))
    burn = run_gcode(text)
    assert len(places) == len(burn.burnt) + len(burn.dark)


def test_the_same_bytes_from_another_process(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    arguments = ["build", "honeycomb", "--set", "layers=2", "--only", "laser", "-o"]
    assert CliRunner().invoke(app, [*arguments, str(tmp_path / "a")]).exit_code == 0
    code = "import sys; from cmpdesign.cli import main; main()"
    command = [sys.executable, "-c", code, *arguments, str(tmp_path / "b")]
    assert subprocess.run(command, capture_output=True, timeout=120, check=False).returncode == 0
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*.*"))
    assert (
        len([file for file in files if not file.name.startswith(".")]) == 4 * 8 + 6 + 8
    )  # with the process sheet, its pictures and its list of materials
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file
