"""``calibrate rig``: through the whole reader against a known sensor; stated deviations against errors; refusals."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import cmpdesign
from cmpdesign.calibration.rig.calibration import RigCalibration, calibrate_rig_markers
from cmpdesign.calibration.rig.causes import FOCUS, GEL, LOCAL, PAD, SIZE, VIEWS
from cmpdesign.calibration.rig.check import check_markers
from cmpdesign.calibration.rig.mirrors import mirror_pairs
from cmpdesign.calibration.rig.unknowns import Unknowns
from cmpdesign.evaluation.simulated.sensor import parse_sensor
from cmpdesign.scene import Medium as DrawnMedium
from cmpdesign.scene import Pinhole, render
from cmpdesign.sensor.sensor_file import load_sensor_file
from extractor import Medium, Reconstructor, Rig, View, ViewExtractor, load_layout
from tests.support.command import refused, run
from tests.support.layouts import small_layout
from tests.support.sensors import small_sensor_text
from tests.support.view_scenes import binocular_scene, flat, noisy, pair, pressed, reference

Array = NDArray[np.float64]

LAYERS, DISTORTION = 5, (-0.05, 0.02, 0.0005, -0.0003, 0.0)
TRUE = Medium(3.0, 1.41, 2.0, 1.49)
DEVIATION = {"gel_mm": 0.05, "gel_index": 0.005, "window_mm": 0.05}
# What calipers and data sheets say about it.
STATED = Medium(3.04, 1.414, 1.97, 1.49)
CAMERA_COV = np.diag(np.square([3.0, 3.0, 2.0, 2.0, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6]))
CAMERA_COV[0, 1] = CAMERA_COV[1, 0] = 3.0**2 * 0.999
PRESS_MM = 0.4


def cameras() -> tuple[Pinhole, ...]:
    """Two views of one camera in mirrors."""
    return tuple(replace(one, distortion=DISTORTION) for one in parse_sensor(small_sensor_text()).cameras)


def measured_text() -> str:
    """The file that a user has before the calibration, with the camera's own calibration in it."""
    focal_px, (x, y) = cameras()[0].focal_px[0] + 2.0, cameras()[0].centre_px
    views = "".join(
        f'[[view]]\nname = "{one.name}"\nfocal_px = [{focal_px}, {focal_px}]\ncentre_px = [{x - 1}, {y + 1.5}]\n'
        f"distortion = {list(DISTORTION)}\narea_px = {list(one.area_px or ())}\nmirrored = true\n\n"
        for one in cameras()
    )
    names = ["fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3"]
    return (
        f'name = "thumb"  # the first one\nlayout = "layout.json"\nsize_px = [640, 360]\n\n{views}'
        f"[medium]\ngel_mm = {STATED.gel_mm}  # calipers\ngel_index = {STATED.gel_index}\n"
        f"window_mm = {STATED.window_mm}\nwindow_index = {STATED.window_index}\n\n[medium_deviation]\n"
        + "".join(f"{name} = {value}\n" for name, value in DEVIATION.items())
        + f"\n[calibration.camera]\nparameters = {json.dumps(names)}\ncovariance = {CAMERA_COV.tolist()}\n"
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pictures of a sensor with two mirrors, window and gel: at rest, below a plate, and pressed."""
    place = tmp_path_factory.mktemp("sensor")
    cmpdesign.write_layout(small_layout("honeycomb", LAYERS), place / "layout.json")
    medium = DrawnMedium(TRUE.gel_mm, TRUE.gel_index, TRUE.window_mm, TRUE.window_index)
    surfaces = {
        "rest": None,
        "plate3": lambda xy: np.column_stack([xy * 1.01, np.full(len(xy), -0.3)]),
        "plate9": lambda xy: np.column_stack([xy * 1.03, np.full(len(xy), -0.9)]),
        "press": lambda xy: pressed(xy, PRESS_MM),
    }
    for number, (name, surface) in enumerate(surfaces.items()):
        scene = replace(binocular_scene(surface, number, layers=LAYERS), camera=cameras(), medium=medium)
        drawn = render(scene, size=(640, 360))
        cv2.imwrite(str(place / f"{name}.png"), drawn.image)
    (place / "measured.toml").write_text(measured_text())
    return place


def true_values() -> Array:
    camera = cameras()[0]
    lens = [*camera.focal_px, *camera.centre_px, *camera.distortion]
    return np.array([*lens, TRUE.gel_mm, TRUE.gel_index, TRUE.window_mm])


@pytest.fixture(scope="module")
def document(folder: Path) -> dict[str, Any]:
    """The answer of ``calibrate rig``, which has written sensor.toml."""
    command = ("calibrate", "rig", folder / "layout.json", folder / "measured.toml", folder / "rest.png")
    command += ("--side", "back")
    plates = ("--step", f"0.3={folder / 'plate3.png'}", "--step", f"0.9={folder / 'plate9.png'}")
    result = run(*command, *plates, "-o", folder / "sensor.toml", "--json")
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_a_sensor_is_calibrated_from_its_pictures(folder: Path, document: dict[str, Any]) -> None:
    output = folder / "sensor.toml"
    values = np.array(list(document["parameters"].values()))
    stated = np.array(list(document["stated"].values()))
    deviations = np.array(list(document["deviations"].values()))[: len(values)]
    assert (np.abs(values - true_values()) < 4 * deviations).all()
    assert (deviations <= stated * 1.001).all() and deviations[0] < 0.5 * stated[0]
    assert "gel_mm" in document["held"] and "left+right.fx_px" not in document["held"]
    assert max(document["rms_px"].values()) < 0.02 and min(document["plate_markers"]) > 80
    (mirrors,) = document["mirrors"]
    assert abs(mirrors["shift_mm"]) < 0.05
    sensor = load_sensor_file(output)
    assert "# the first one" in sensor.text and sensor.layout == folder / "layout.json"
    assert sensor.table.calibration.rig is not None and sensor.table.calibration.rig.steps_mm == (0.3, 0.9)
    assert sensor.rig.layout_digest == load_layout(sensor.layout).digest
    for view, true in zip(sensor.rig.views, cameras(), strict=True):
        np.testing.assert_allclose(view.R_camera_from_layout, true.R_camera_from_layout, atol=0.01)
    # the file is a rig: the depth of a press lies within what remains undetermined
    views = ViewExtractor(load_layout(sensor.layout), sensor.rig, "accurate")
    rest, press = (views.extract(cv2.imread(str(folder / f"{name}.png"))) for name in ("rest", "press"))
    shape = Reconstructor(views.layout, sensor.rig, rest).reconstruct(press)
    true_mm = pressed(views.layout.xy_mm, PRESS_MM)[:, 2]
    deepest = int(true_mm.argmin())
    sigma_mm = np.hypot(
        shape.displacement_systematic_mm[deepest, 2], np.sqrt(shape.displacement_cov_mm2[deepest, 2, 2])
    )
    assert abs(shape.displacement_mm[deepest, 2] - true_mm[deepest]) < 4 * sigma_mm < 0.03
    assert shape.displacement_systematic_mm[deepest, 2] == pytest.approx(
        document["depth_share"] * PRESS_MM, rel=1.0
    )


def test_a_sensor_is_checked_by_new_pictures(folder: Path, document: dict[str, Any], tmp_path: Path) -> None:
    words = ("calibrate", "check", folder / "sensor.toml")
    same = run(*words, folder / "rest.png", "--json")
    assert same.exit_code == 0, same.output
    found = json.loads(same.stdout)
    assert found["holds"] and found["misfit"] < 1.3 and found["steps"] == []
    assert found["stated_px"] == pytest.approx(document["rms_px"], rel=1e-3)
    assert found["rms_px"] == pytest.approx(document["rms_px"], rel=0.2)
    touched = run(*words, folder / "rest.png", folder / "press.png")
    assert touched.exit_code == 1 and "touched" in touched.output and "without contact" in touched.output
    # a lens that shows all a hundredth smaller than the file says
    text = (folder / "sensor.toml").read_text()
    larger = [line if "focal_px" not in line else _times(line, 1.01) for line in text.splitlines()]
    (tmp_path / "sensor.toml").write_text("\n".join(larger))
    shutil.copy(folder / "layout.json", tmp_path)
    refocused = run("calibrate", "check", tmp_path / "sensor.toml", folder / "rest.png", "--json")
    assert refocused.exit_code == 1
    found = json.loads(refocused.stdout)
    first = found["causes"][0]
    assert first["cause"] == FOCUS and first["likely"] and "calibrate camera" in found["steps"][0]
    assert first["changes"]["left+right.focal_share"] == pytest.approx(-0.01, abs=0.001)
    assert "first: cmpdesign calibrate rig" in refused(
        "calibrate", "check", folder / "measured.toml", folder / "rest.png"
    )


def _times(line: str, factor: float) -> str:
    name, _, values = line.partition("=")
    return f"{name}= {[value * factor for value in json.loads(values)]}"


def test_bad_input_is_one_line_and_writes_nothing(folder: Path) -> None:
    rest, rig = folder / "rest.png", folder / "measured.toml"
    command = ("calibrate", "rig", folder / "layout.json", rig, rest)
    before = sorted(path.name for path in folder.iterdir())
    assert "is RIG itself" in refused(*command, "-o", rig)
    assert "beside" in refused(*command, "-o", folder.parent / "sensor.toml")
    assert "expected MM=PICTURE" in refused(*command, "-o", folder / "new.toml", "--step", "plate.png")
    narrow = folder / "narrow.toml"
    narrow.write_text(rig.read_text().replace("distortion = [", "distortion = [0.0, 0.0, 0.0, "))
    message = refused(*command[:3], narrow, rest, "--side", "back", "-o", folder / "new.toml")
    narrow.unlink()
    assert "covariance of 9 parameters, view 'left' has 12" in message
    assert sorted(path.name for path in folder.iterdir()) == before


def sensor_views() -> tuple[View, ...]:
    """Two views of one camera in mirrors, through window and gel."""
    areas = ((0, 0, 640, 480), (640, 0, 640, 480))
    return tuple(
        replace(view, area_px=area, medium=TRUE)
        for view, area in zip(pair(mirrored=(True, True)), areas, strict=True)
    )


def drawn_rig(views: tuple[View, ...], rng: np.random.Generator) -> Rig:
    """What a user states about these views: numbers off by their deviations."""
    changed = {name: getattr(TRUE, name) + sigma * rng.normal() for name, sigma in DEVIATION.items()}
    offsets = np.linalg.cholesky(CAMERA_COV) @ rng.normal(size=9)
    lens = np.array([*views[0].focal_px, *views[0].centre_px, *views[0].distortion]) + offsets
    return Rig(
        tuple(
            View(view.name, tuple(lens[:2]), tuple(lens[2:4]), tuple(lens[4:]), view.area_px, view.mirrored,
                 medium=replace(TRUE, **changed))
            for view in views
        ),
        DEVIATION,
    )  # fmt: skip


def _refocused(view: View) -> View:
    return replace(view, focal_px=(view.focal_px[0] * 1.003, view.focal_px[1] * 1.003))


def _remounted(view: View) -> View:
    turn = cv2.Rodrigues(np.array([0.01, 0.02, -0.03]))[0]
    shift = view.t_camera_from_layout_mm + view.R_camera_from_layout @ [0.2, 0.1, 0.05]
    return view.at(view.R_camera_from_layout @ turn, shift)


CHANGES = {
    "nothing": ((), lambda view: view, 1.0),
    "focus": ((FOCUS,), _refocused, 1.0),
    "pad": ((PAD,), _remounted, 1.0),
    "mirror": ((VIEWS,), lambda view: view.turned([0.002, 0, 0.001, 0, 0, 0]) if view.name == "left" else view, 1.0),
    "gel": ((GEL,), lambda view: replace(view, medium=replace(TRUE, gel_mm=3.3, gel_index=1.43)), 1.0),
    "size": ((SIZE,), lambda view: view, 1.002),
    "touch": ((LOCAL,), lambda view: view, 1.0),
}  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_the_cause_of_larger_residuals_is_named(change: str) -> None:
    rng, layout, views = np.random.default_rng([46, 3]), reference(layers=5), sensor_views()
    likely, changed, size = CHANGES[change]
    places = pressed(layout.xy_mm, 0.2) if change == "touch" else flat(layout) * size
    rest = {
        name: [noisy(layout, changed(view), places, rng, 0.01) for view in views]
        for name in ("a.png", "b.png")
    }
    found = check_markers(
        layout, Rig(views), rest, stated_px={}, views={}, cameras={}, force=None, ages_days={}
    )
    assert found.holds == (change == "nothing")
    assert found.found == likely
    assert {one.cause for one in found.causes if one.likely} == {*likely} - {LOCAL}
    if change == "focus":  # the file's focal length is smaller than the true one, so that all is read larger
        deeper = pressed(layout.xy_mm, 0.5)
        read = [noisy(layout, changed(view), deeper, rng, 1e-4) for view in views]
        still = [noisy(layout, changed(view), flat(layout), rng, 1e-4) for view in views]
        shape = Reconstructor(layout, Rig(views), still).reconstruct(read)
        deep = deeper[:, 2] < -0.25
        ratio = shape.displacement_mm[deep, 2] / deeper[deep, 2]
        assert found.depth_error == pytest.approx(ratio.mean() - 1, abs=0.002)


def test_two_mirrors_are_found_up_to_a_turn_about_their_common_line() -> None:
    normals = np.array([[np.cos(a), 0.02, np.sin(a)] for a in np.radians([12, 168])])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    real = replace(sensor_views()[0], mirrored=None, R_camera_from_layout=np.diag([1.0, -1, -1.0]),
                   t_camera_from_layout_mm=np.array([0.3, -0.2, 40.0]))  # fmt: skip
    views = []
    for number, (normal, distance_mm) in enumerate(zip(normals, (6.0, 7.0), strict=True)):
        mirror = np.eye(3) - 2 * np.outer(normal, normal)
        placed = real.at(
            mirror @ real.R_camera_from_layout,
            mirror @ real.t_camera_from_layout_mm + 2 * distance_mm * normal,
        )
        views.append(replace(placed, name=f"v{number}"))
    (found,) = mirror_pairs(Unknowns(tuple(views), ()), tuple(views))
    assert found.shift_mm == pytest.approx(0, abs=1e-9)
    between = np.degrees(np.arccos(abs(normals[0] @ normals[1])))
    assert min(found.angle_deg, 180 - found.angle_deg) == pytest.approx(between)
    first, second = (np.eye(3) - 2 * np.outer(normal, normal) for normal in found.normals)
    turn = views[0].R_camera_from_layout @ views[1].R_camera_from_layout.T
    np.testing.assert_allclose(first @ second, turn, atol=1e-9)
    # both planes reflect the virtual cameras to one and the same real camera
    at = [
        mirror @ (view.t_camera_from_layout_mm - 2 * distance_mm * np.array(normal))
        for mirror, view, normal, distance_mm in zip(
            (first, second), views, found.normals, found.distances_mm, strict=True
        )
    ]
    np.testing.assert_allclose(at[0], at[1], atol=1e-9)


def calibrated(seed: int, steps_mm: tuple[float, ...]) -> tuple[RigCalibration, float]:
    """A calibration, and the error of a depth over its stated deviation."""
    rng, layout, views = np.random.default_rng([46, seed]), reference(layers=4), sensor_views()
    rest = [noisy(layout, view, flat(layout), rng, 0.01) for view in views]
    steps = {}
    offset_mm = rng.normal(0, 0.05)
    for way_mm in steps_mm:
        plate = flat(layout) * (1 + 0.02 * way_mm)
        plate[:, 2] = offset_mm - way_mm - rng.normal(0, 0.001)
        steps[way_mm] = [noisy(layout, view, plate, rng, 0.01) for view in views]
    found = calibrate_rig_markers(
        layout, drawn_rig(views, rng), [rest], steps, camera_cov=CAMERA_COV, step_sigma_mm=0.001
    )
    true_mm = pressed(layout.xy_mm, 0.5)
    read = [noisy(layout, view, true_mm, rng, 0.01) for view in views]
    shape = Reconstructor(layout, found.rig, rest).reconstruct(read)
    deep = true_mm[:, 2] < -0.25
    noise_mm2 = shape.displacement_cov_mm2[deep, 2, 2].mean() / deep.sum()
    sigma_mm = np.sqrt(shape.displacement_systematic_mm[deep, 2].mean() ** 2 + noise_mm2)
    return found, float((shape.displacement_mm[:, 2] - true_mm[:, 2])[deep].mean() / sigma_mm)


@pytest.mark.slow
@pytest.mark.parametrize(("steps_mm", "share"), [((), 0.005), ((0.4, 1.4), 0.003)])
def test_stated_deviations_are_true(steps_mm: tuple[float, ...], share: float) -> None:
    view = sensor_views()[0]
    lens = [*view.focal_px, *view.centre_px, *view.distortion]
    true = np.array([*lens, TRUE.gel_mm, TRUE.gel_index, TRUE.window_mm])
    found = [calibrated(seed, steps_mm) for seed in range(16)]
    errors = [(one.values - true) / one.deviations[: len(true)] for one, _ in found]
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.3
    assert 0.7 < np.sqrt(np.mean(np.square([depth for _, depth in found]))) < 1.4
    assert max(one.scale for one, _ in found) < 1.2
    assert np.mean([one.depth_share for one, _ in found]) < share
