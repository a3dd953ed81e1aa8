"""The job: refused or made, its order and time, and the picture of the carved pad."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pypdfium2
import pytest
import resvg_py
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from cmpdesign.cli import app
from cmpdesign.errors import DesignError
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.patterns.colors import COLORS
from cmpdesign.products.laser.as_made import burnt_cell_outlines_mm
from cmpdesign.products.laser.as_made_svg import as_made_svg
from cmpdesign.products.laser.checks import count_duplicate_paths, count_open_paths
from cmpdesign.products.laser.figures import pass_timing
from cmpdesign.products.laser.formats.drawing import job_drawing
from cmpdesign.products.laser.formats.gcode import drawing_to_gcode
from cmpdesign.products.laser.job import LaserJob
from cmpdesign.products.laser.library import load_machine, load_material, machines, materials
from cmpdesign.products.laser.paths.beam import BeamFootprint
from cmpdesign.products.laser.paths.order import order_cells, shortest_pause
from cmpdesign.products.laser.paths.strokes import ragged_strokes
from cmpdesign.products.laser.paths.timing import move_times_s
from cmpdesign.products.laser.paths.tour import find_short_tour, tour_length_mm
from cmpdesign.products.laser.process_sheet import process_sheet, weighings
from extractor import Extractor, parse_layout
from tests.support.laser_tools import Points, groups_of, made_job, run_gcode

PX_PER_MM = 20.0


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_the_folder_holds_what_a_shop_needs(tmp_path: Path) -> None:
    result = run(
        "build",
        "honeycomb",
        "-o",
        tmp_path,
        "--only",
        "laser",
        "--set",
        "layers=3",
        "--set",
        "laser.outline=true",
    )
    assert result.exit_code == 0, result.output
    names = {path.name for path in (tmp_path / "laser").glob("[!.]*")}
    jobs = ["0-holes", "1-red", "2-green", "3-blue", "4-white", "5-outline", "job", "coupon", "grid"]
    expected = {f"{job}.{suffix}" for job in jobs for suffix in ("svg", "dxf", "lbrn2", "gcode")}
    assert names == expected | {
        "as-made.svg",
        "job-sheet.html",
        "process-sheet.html",
        "process-sheet.pdf",
        "materials.csv",
        "pictures",
        "coupon.json",
        "grid.json",
    }
    document = pypdfium2.PdfDocument((tmp_path / "laser" / "process-sheet.pdf").read_bytes())
    pages = [page.get_textpage().get_text_range() for page in document]
    assert len(pages) == 2 + 6 + 1 and all("* assumed" in page for page in pages)
    assert all(f"Pass {name}" in page for name, page in zip(jobs[:6], pages[2:8], strict=True))
    assert {path.name for path in tmp_path.glob("[!.]*")} == {"as-made", "laser", "report.json"}
    assert [path.name for path in (tmp_path / "as-made").iterdir()] == ["laser.json"]
    assert "assumed" in result.stderr
    figures = json.loads((tmp_path / "report.json").read_text())["laser"]
    assert [one["name"] for one in figures["passes"]] == jobs[:6]
    red = figures["passes"][1]
    assert red["front"]["area_error_percent"] == pytest.approx(0, abs=1e-3)
    assert red["front"]["web_mm"] > 1 and red["back"]["web_mm"] > red["front"]["web_mm"]
    sheet = (tmp_path / "laser" / "job-sheet.html").read_text()
    for text in (
        "Fill.",
        "Cure.",
        "2-green",
        f"{red['front']['corner_loss_mm']:.3f}",
        "T1",
        "CO2 tube, 40 W",
    ):
        assert text in sheet
    assert "<script" not in sheet and "http" not in sheet


@pytest.mark.parametrize(("taper_deg", "corner"), [(0, "overcut"), (3, "plain")])
def test_masses_fill_the_burnt_cavities(taper_deg: float, corner: str) -> None:
    """Prisms of the nominal cells without taper; else the burnt outlines at 201 depths, by the trapezoidal rule."""
    job = made_job(laser__taper_deg=str(taper_deg), laser__corner=corner)
    depths = np.linspace(0, job.setup.depth_mm, 201)
    for one in job.cell_passes:
        assert one.cavities is not None
        areas = [
            sum(
                shapely.Polygon(ring).area
                for ring in burnt_cell_outlines_mm(one, job.front.at_depth(z, taper_deg))
            )
            for z in depths
        ]
        mix = weighings(job)[one.name]
        cast_g = np.trapezoid(areas, depths) * mix.silicone.density_g_cm3.value / 1000
        assert mix.cast_g == pytest.approx(cast_g, rel=2e-4)
        if not taper_deg:
            cells = len(one.cavities.cell) * np.sqrt(3) / 4 * 1.5**2
            assert mix.cast_g == pytest.approx(cells * job.setup.depth_mm * 1.07e-3, rel=1e-3)


def test_a_fill_of_another_chemistry_is_warned_of(tmp_path: Path) -> None:
    text = materials()["silicone-black"].read_text(encoding="utf-8")
    material = tmp_path / "mine.toml"
    material.write_text(text.replace('"ecoflex-00-30"', '"mold-max-30"'), encoding="utf-8")
    job = made_job(laser__material=str(material))
    sheet = process_sheet(job, tuple(pass_timing(job, one) for one in job.passes), ())
    warned = [text for step in sheet.steps for text in step.warnings]
    assert len(warned) == 4 and "may not cure on" in warned[0] and "tin against platinum" in warned[0]


@pytest.mark.parametrize(
    ("settings_", "expected"),
    [
        (["laser.kerf_mm=1.2mm", "fiducials.diameter_mm=3"], "that are narrower than the kerf: "),
        (
            ["fiducials.diameter_mm=0.1"],
            "diameter of the fiducial holes, against the kerf: 0.1 mm, limit 0.171 mm; make fiducials.diameter_mm",
        ),
        (["laser.kerf_mm=0", "laser.mode=pocket"], "kerf of a pocket: 0 mm"),
        (
            ["laser.minimum_web_mm=2mm"],
            "smallest web of 1-red at the front: 1.35 mm, limit 2 mm; make pitch_mm larger",
        ),
        (["layers=8", "pitch_mm=30"], "width of the job, on the bed: "),
        (["laser.x_mm=290"], "edge of the job beyond the bed's width: "),
        (["print_ids=true"], "a laser burns outlines only; leave print_ids out"),
        (["laser.taper_deg=6"], "the beam closes before the back"),
        (["laser.depth_mm=2mm"], "depth of the cavities in this material: 2 mm, limit 1 mm"),
        (["laser.speed_mm_s=900"], "speed: 900 mm/s, limit 400 mm/s"),
        (["laser.mode=pocket", "laser.hatch_mm=0.2"], "ridges stay between the lines"),
        (
            ["fiducials.gap_mm=0", "fiducials.diameter_mm=0.5"],
            "fiducial hole and the pattern: 0.104 mm, limit 0.3 mm",
        ),
        (["laser.face=back", "laser.taper_deg=4"], "into cured cells"),
        (["laser.machine=co2-40"], "no such machine (did you mean co2-40w?)"),
        (["laser.material=silicon-black"], "did you mean silicone-black?"),
        (
            ["laser.machine=diode-blue-10w", "laser.material=pdms"],
            "has no settings for this machine, only for co2-40w, uv-5w",
        ),
        (["laser.kerf_mm=0.1", "laser.kerf_x_mm=0.1"], "fix the kerf twice"),
        (["laser.corner=round"], "laser.corner = 'round' must be 'plain' or 'overcut'"),
        (["laser.cornr=plain"], "laser.cornr is unknown (did you mean corner?)"),
    ],
)
def test_bad_jobs_are_refused(settings_: list[str], expected: str, tmp_path: Path) -> None:
    flags = [flag for text in settings_ for flag in ("--set", text)]
    name = "square" if "fiducials.gap_mm=0" in settings_ else "honeycomb"
    result = run("build", name, "-o", tmp_path / "out", "--only", "laser", *flags)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
    assert expected in result.stderr
    assert not (tmp_path / "out").exists()


def test_double_and_flat_paths_are_found() -> None:
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    twice = ragged_strokes([square, np.roll(square, 2, axis=0)[::-1], square + 0.01], [0, 1, 2], closed=True)
    assert count_duplicate_paths(twice) == 1 and count_open_paths(twice) == 0
    flat = ragged_strokes([square, np.array([(0, 0), (1, 1), (2, 2)], dtype=float)], [0, 1], closed=True)
    assert count_open_paths(flat) == 1 and count_duplicate_paths(flat) == 0
    assert count_open_paths(ragged_strokes([square], [0], closed=False)) == 1


def test_every_machine_and_material_reads_and_names_its_sources() -> None:
    kinds = {load_machine(name).kind for name in machines()}
    assert {"co2", "diode", "fibre", "uv"} == kinds
    for name in materials():
        material = load_material(name)
        assert set(material.on) <= set(machines())
        for settings_ in material.on.values():
            assert all(len(getattr(settings_, field).source) >= 3 for field in type(settings_).model_fields)


@pytest.mark.parametrize("material", ["silicone-black", "silicone-translucent", "pdms"])
def test_every_shipped_setting_makes_a_job(material: str) -> None:
    for machine in load_material(material).on:
        for mode in ("cut", "pocket"):
            job = made_job(laser__machine=machine, laser__material=material, laser__mode=mode)
            assert min(job.back.x_mm, job.back.y_mm) > 0
            assert all(one.cavities.exists.all() for one in job.cell_passes)  # type: ignore[union-attr]


def test_settings_of_pockets_are_needed_by_pockets_alone(tmp_path: Path) -> None:
    """Each of the three settings may also come from the design."""
    material = tmp_path / "cuts.toml"
    lines = materials()["silicone-black"].read_text(encoding="utf-8").splitlines(keepends=True)
    material.write_text("".join(line for line in lines if not line.startswith("pocket_")), encoding="utf-8")
    complete = made_job(laser__material="silicone-black")
    assert made_job(laser__material=str(material)).setup.repeats == complete.setup.repeats
    pocket = {"laser__material": str(material), "laser__mode": "pocket"}
    for field, option, value in (
        ("pocket_power_percent", "power_percent", "20"),
        ("pocket_speed_mm_s", "speed_mm_s", "100"),
        ("pocket_depth_per_pass_mm", "passes", "7"),
    ):
        with pytest.raises(DesignError, match=rf"has no {field} for this machine.*set laser.{option}$"):
            made_job(**pocket)
        pocket[f"laser__{option}"] = value
    assert made_job(**pocket).setup.repeats == 7


def test_own_machine_and_material_files(tmp_path: Path) -> None:
    machine = tmp_path / "mine.toml"
    machine.write_text(machines()["co2-40w"].read_text().replace("value = 300.0", "value = 60.0"))
    material = tmp_path / "gel.toml"
    material.write_text(materials()["silicone-black"].read_text().replace("[on.co2-40w]", "[on.mine]"))
    flags = ["--set", f"laser.machine={machine}", "--set", f"laser.material={material}"]
    result = run("build", "tac3d", "-o", tmp_path / "out", "--only", "laser", *flags)
    assert result.exit_code == 0, result.output
    assert 'width="60mm"' in (tmp_path / "out" / "laser" / "1-red.svg").read_text()
    machine.write_text("name = 3")
    assert run("build", "tac3d", "-o", tmp_path, "--only", "laser", *flags).exit_code == 2
    material.write_text(materials()["pdms"].read_text().replace("taper_deg", "tapr_deg"))
    machine.write_text(machines()["co2-40w"].read_text())
    result = run("build", "tac3d", "-o", tmp_path, "--only", "laser", *flags)
    assert result.exit_code == 2 and (
        "taper_deg is missing" in result.stderr or "did you mean taper_deg" in result.stderr
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 40), st.integers(0, 10_000))
def test_a_tour_visits_every_cell_once(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    entries = rng.uniform(0, 20, (count, 1, 2)) + rng.uniform(0, 0.5, (count, 3, 2))
    order, entry = find_short_tour(entries)
    assert sorted(order.tolist()) == list(range(count))
    assert ((entry >= 0) & (entry < 3)).all()


def test_a_small_tour_is_the_shortest() -> None:
    from itertools import permutations, product

    rng = np.random.default_rng(5)
    for _ in range(5):
        entries = rng.uniform(0, 10, (6, 1, 2)) + rng.uniform(-0.5, 0.5, (6, 2, 2))
        order, entry = find_short_tour(entries)
        ways = [
            tour_length_mm(entries, np.array(p), np.array(q))
            for p in permutations(range(6))
            for q in product(range(2), repeat=6)
        ]
        assert tour_length_mm(entries, order, entry) <= 1.12 * min(ways)


def test_orders() -> None:
    job = made_job(layers="10")
    one = job.cell_passes[0]
    assert one.cavities is not None
    centres, found = one.cavities.nominal_mm.mean(axis=1), {}
    for name in ("travel", "heat", "given"):
        order, entry = order_cells(one.cavities.entries_mm, name)  # type: ignore[arg-type]
        assert sorted(order.tolist()) == list(range(len(centres)))
        steps = np.arange(len(order), dtype=float)
        found[name] = (
            tour_length_mm(one.cavities.entries_mm, order, entry),
            shortest_pause(order, centres, steps),
        )
    assert found["travel"][0] <= found["given"][0] < 0.5 * found["heat"][0]
    assert found["heat"][1] >= 4 > found["travel"][1] == 1
    assert order.tolist() == list(range(len(order)))


def test_times_are_those_of_the_moves() -> None:
    assert move_times_s(np.array([100.0]), 50.0, 1000.0)[0] == pytest.approx(2.05)
    assert move_times_s(np.array([0.1]), 50.0, 1000.0)[0] == pytest.approx(0.02)
    job = made_job(laser__passes="3")
    one, machine = job.cell_passes[0], job.setup.machine
    burn = run_gcode(drawing_to_gcode(job_drawing(job).with_one_pass(one)))

    def length(moves: Any) -> Any:
        return np.hypot(*(np.array(moves)[:, 2:4] - np.array(moves)[:, :2]).T)

    accel = machine.acceleration_mm_s2.value
    total = move_times_s(length(burn.burnt), one.speed_mm_s, accel).sum()
    total += move_times_s(length(burn.dark), machine.travel_mm_s.value, accel).sum()
    found = pass_timing(job, one)
    assert found.time_s == pytest.approx(total, abs=2e-3)
    assert found.burn_mm == pytest.approx(length(burn.burnt).sum(), abs=1e-2)


def drawn_from_gcode(job: LaserJob) -> str:
    """The pattern in its inks, from nothing but each pass' program and the kerf."""
    low, high = job.outline_mm.min(axis=0), job.outline_mm.max(axis=0)
    radii = np.array([job.front.x_mm, job.front.y_mm])
    inks, shapes = job.layout.palette, []

    def path(polygon: Points, ink: str) -> str:
        points = "L".join(f"{x - low[0]:.5f} {high[1] - y:.5f}" for x, y in polygon)
        return f'<path fill="{ink}" d="M{points}Z"/>'

    shapes.append(path(job.outline_mm, inks["black"]))
    for one in job.cell_passes:
        assert one.color is not None
        for stroke in groups_of(run_gcode(drawing_to_gcode(job_drawing(job).with_one_pass(one)))):
            line = shapely.LineString(np.vstack([stroke[:, :2], stroke[-1:, 2:]]) / radii)
            rim = shapely.buffer(line, 1.0, quad_segs=16).exterior
            shapes.append(path(shapely.get_coordinates(rim) * radii, inks[COLORS[one.color]]))
    width, height = high - low
    size = f'width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    return head + "".join(shapes) + "</svg>"


def seen(svg: str, job: LaserJob) -> tuple[Points, Points, int]:
    """Extracted and true marker places in px of a rendered drawing, and how many ids are wrong."""
    png = resvg_py.svg_to_bytes(
        svg_string=svg, dpi=int(25.4 * PX_PER_MM), skip_system_fonts=True, background="#808080"
    )
    image = cv2.imdecode(np.frombuffer(bytes(png), np.uint8), cv2.IMREAD_COLOR)
    pad = 40
    image = cv2.GaussianBlur(
        cv2.copyMakeBorder(image, *[pad] * 4, cv2.BORDER_CONSTANT, value=(128, 128, 128)), (0, 0), 1.0
    )
    layout = job.layout
    markers = Extractor(parse_layout(layout_to_json(layout))).extract(image)
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    scale = int(25.4 * PX_PER_MM) / 25.4
    true = (
        np.column_stack([layout.marker_xy_mm[:, 0] - low[0], high[1] - layout.marker_xy_mm[:, 1]]) * scale
        + pad
        - 0.5
    )
    measured = np.isfinite(markers.xy_px).all(axis=1)
    assert measured[layout.present].mean() > 0.99
    away = np.hypot(*(markers.xy_px - true)[measured].T)
    return markers.xy_px[measured], true[measured], int((away > 0.3 * 1.5 * scale).sum())


@pytest.mark.parametrize("name", ["honeycomb", "round"])
@pytest.mark.parametrize("corner", ["plain", "overcut"])
def test_the_burnt_pattern_is_read_with_no_wrong_id(name: str, corner: str) -> None:
    """From the programs alone: swept, inked, rendered, extracted. Corners have their designed positions."""
    job = made_job(name, laser__corner=corner, layers="6", laser__kerf_mm="0.2")
    for svg in (drawn_from_gcode(job), as_made_svg(job)):
        found, true, wrong = seen(svg, job)
        assert wrong == 0
        rms_mm = float(np.sqrt(((found - true) ** 2).sum(axis=1).mean())) / PX_PER_MM
        assert rms_mm < 0.02, f"corners move by {1000 * rms_mm:.1f} um"


def test_paths_without_compensation_are_the_outlines(tmp_path: Path) -> None:
    """Paths without compensation, for shops that compensate; the job sheet, the program and the report state the
    absence.
    """
    settings_ = ["layers=3", "laser.kerf_mm=0", "laser.outline=true", "laser.taper_deg=1"]
    flags = [flag for text in settings_ for flag in ("--set", text)]
    result = run("build", "honeycomb", "-o", tmp_path, "--only", "laser", *flags)
    assert result.exit_code == 0, result.output
    assert "leave laser.taper_deg out" in result.stderr
    job = made_job(laser__kerf_mm="0", laser__outline="true")
    for one in job.cell_passes:
        assert one.cavities is not None
        corners = job.layout.marker_xy_mm[job.layout.cell_corners[one.cavities.cell]] + job.origin_mm
        for path, cell in zip(one.walls, corners, strict=True):
            assert len(path) == 3
            np.testing.assert_allclose(sorted(path.tolist()), sorted(cell.round(4).tolist()), atol=1.1e-4)
    holes = [shapely.Polygon(path) for path in job.passes[0].walls]
    diameter = job.layout.fiducial_diameter_mm
    for hole, centre in zip(holes, job.fiducials_mm, strict=True):
        ring = shapely.get_coordinates(hole)
        np.testing.assert_allclose(np.hypot(*(ring - centre).T), diameter / 2, atol=2e-4)
    np.testing.assert_allclose(next(iter(job.passes[-1].walls)), job.outline_mm, atol=1e-4)
    figures = json.loads((tmp_path / "report.json").read_text())["laser"]
    assert figures["compensated"] is False and figures["kerf_front_mm"] == [0, 0]
    assert figures["passes"][1]["front"]["area_error_percent"] == 0
    assert "not compensated" in (tmp_path / "laser" / "job.gcode").read_text()
    assert "Not compensated for the kerf" in (tmp_path / "laser" / "job-sheet.html").read_text()


@given(st.floats(0.05, 0.4), st.floats(0.05, 0.4), st.floats(1.001, 3.0))
@settings(max_examples=20, deadline=None)
def test_the_smallest_hole_can_be_burnt(kerf_x_mm: float, kerf_y_mm: float, factor: float) -> None:
    """Above the limit of a fiducial's diameter a path's points lie on their own side of the centre, else not."""
    beam = BeamFootprint.of_kerf(kerf_x_mm, kerf_y_mm)
    for diameter, simple in ((factor * beam.smallest_hole_mm, True), (0.6 * min(beam.kerf_mm), False)):
        job = made_job(
            laser__kerf_x_mm=str(kerf_x_mm),
            laser__kerf_y_mm=str(kerf_y_mm),
            fiducials__diameter_mm=str(diameter),
        )
        path = next(iter(job.passes[0].walls)) - job.fiducials_mm[0]
        angle = np.linspace(0, 2 * np.pi, len(path), endpoint=False)
        outward = (path * np.column_stack([np.cos(angle), np.sin(angle)])).sum(axis=1)
        assert (outward > -1e-4).all() == simple
