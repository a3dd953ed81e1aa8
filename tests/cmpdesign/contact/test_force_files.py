"""From a sensor's files to forces in tables: ``calibrate gel``, ``reconstruct --contact``, ``calibrate force``."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import zarr

from extractor import ContactReason, ForceModel
from tests.support.command import refused, run
from tests.support.tracking.files import loaded
from tests.support.tracking.foxglove_client import free_port, received_while
from tests.support.tracking.messages import points_of, read_messages
from tests.support.tracking.press import write_press
from tests.support.view_scenes import binocular, rig_of

pytestmark = pytest.mark.slow  # the block of a pad of 8 layers
ELASTOMER = "[elastomer]\nthickness_mm = 4\npoisson = 0.5\nmarker_depth_mm = 0.5\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_press(tmp_path_factory.mktemp("made"))
    views = (folder / "rig.toml").read_text(encoding="utf-8")
    (folder / "sensor.toml").write_text(f"{views}\n{ELASTOMER}young_mpa = 0.3\n", encoding="utf-8")
    (folder / "soft.toml").write_text(f"{views}\n{ELASTOMER}", encoding="utf-8")
    result = run(
        "calibrate", "gel", folder / "layout.json", folder / "sensor.toml", "-o", folder / "gel.npz", "--json"
    )
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["marker_depth_mm"] == 0.5
    return folder


def reconstruct(
    made: Path, output: Path, gel: str = "gel.npz", rig: str = "sensor.toml"
) -> tuple[object, ...]:
    words = ("reconstruct", made / "layout.json", made / rig, "0", made / "frames")
    return (*words, "-o", output, "--contact", made / gel)


def test_tables_hold_force_torque_and_traction(made: Path, tmp_path: Path) -> None:
    for name in ("a.npz", "b.csv"):
        assert run(*reconstruct(made, tmp_path / name)).exit_code == 0
    with np.load(tmp_path / "a.npz") as file:
        table = dict(file)
    frames, markers = len(table["frame"]), len(table["layer"])
    assert table["force_n"].shape == table["torque_nmm"].shape == (frames, 3)
    assert table["force_cov_n2"].shape == (frames, 6)
    assert table["marker_traction_mpa"].shape == (frames, markers, 3)
    # the first frame is at rest, the third has a view without a pattern, the last is pressed
    assert (table["force_n"][0] == 0).all() and np.isnan(table["force_n"][2]).all()
    assert table["force_n"][3, 2] < -0.05 and table["contact_regions"][3] >= 1
    with (tmp_path / "b.csv").open(encoding="utf-8", newline="") as text:
        rows = list(csv.DictReader(text))
    points = len(rows) // frames
    last = rows[3 * points]
    assert float(last["force_z_n"]) == pytest.approx(table["force_n"][3, 2], abs=1e-6)
    assert float(last["traction_z_mpa"]) == pytest.approx(table["marker_traction_mpa"][3, 0, 2], abs=1e-6)


def test_a_recording_and_a_live_viewer_get_the_tables_wrench(made: Path, tmp_path: Path) -> None:
    """Torques of messages are about the origin of the markers' frame, in the plane of the pattern."""
    assert run(*reconstruct(made, tmp_path / "a.npz")).exit_code == 0
    table, port = loaded(tmp_path / "a.npz"), free_port()
    live = ("--live", "foxglove", "--live-port", port, "--live-wait", 30)

    def follow() -> None:
        result = run(*reconstruct(made, tmp_path / "a.mcap"), *live)
        assert result.exit_code == 0, result.output

    shown, messages = received_while(follow, port), read_messages(tmp_path / "a.mcap")
    for topic, kept in messages.items():
        assert [data for _, data in shown.messages[topic]] == [one.message.data for one in kept], topic
    wrenches = [one.decoded_message.wrench for one in messages["/tactile/wrench"]]
    forces = np.array([[one.force.x, one.force.y, one.force.z] for one in wrenches])
    np.testing.assert_array_equal(forces, table["force_n"])
    torques = 1e3 * np.array([[one.torque.x, one.torque.y, one.torque.z] for one in wrenches])
    np.testing.assert_allclose(
        torques, table["torque_nmm"] + np.cross([0, 0, 0.5], table["force_n"]), rtol=1e-12
    )
    points = np.stack([points_of(one) for one in messages["/tactile/markers"]])
    traction = (table["marker_traction_mpa"].astype(float) * 1e6).astype("f4")
    for place, axis in enumerate("xyz"):
        np.testing.assert_array_equal(points[f"traction_{axis}"][..., 0], traction[..., place])
    regions = [points_of(one) for one in messages["/tactile/regions"]]
    assert [len(one) for one in regions] == table["contact_regions"].tolist()
    last = regions[3]
    count = len(last)
    np.testing.assert_array_equal(last["force_z"][:, 0], table["region_force_n"][3, :count, 2].astype("f4"))
    np.testing.assert_allclose(last["area"][:, 0], 1e-6 * table["region_area_mm2"][3, :count], rtol=1e-6)
    values = {one.key: one.value for one in messages["/diagnostics"][3].decoded_message.status[0].values}
    assert float(values["force_sigma_z"]) == pytest.approx(np.sqrt(table["force_cov_n2"][3, 5]), rel=1e-5)


def test_exports_take_the_forces_over(made: Path, tmp_path: Path) -> None:
    assert run(*reconstruct(made, tmp_path / "a.npz")).exit_code == 0
    table = loaded(tmp_path / "a.npz")
    assert run("export", "zarr", tmp_path / "a.npz", "-o", tmp_path / "a.zarr").exit_code == 0
    data = zarr.open_group(str(tmp_path / "a.zarr"), mode="r")["data"]
    words = ("export", "lerobot", tmp_path / "a.npz", "-o", tmp_path / "set", "--fps", "30")
    assert run(*words).exit_code == 0
    rows = pyarrow.parquet.read_table(next((tmp_path / "set/data").rglob("*.parquet")))
    for name in ("force_n", "torque_cov_nmm2", "contact_reason"):
        np.testing.assert_array_equal(
            data[f"tactile_{name}"][:], table[name].astype(data[f"tactile_{name}"].dtype)
        )
        kept = np.array(rows[f"observation.tactile.{name}"].to_pylist()).reshape(table[name].shape)
        np.testing.assert_array_equal(kept, data[f"tactile_{name}"][:])
    words = ("reconstruct", made / "layout.json", made / "sensor.toml", "0", made / "frames")
    assert run(*words, "-o", tmp_path / "b.npz").exit_code == 0
    both = (tmp_path / "a.npz", tmp_path / "b.npz")
    assert "the contact is without" in refused("export", "zarr", *both, "-o", tmp_path / "c.zarr")


def test_one_camera_gives_about_the_force_of_two(made: Path, tmp_path: Path) -> None:
    view = rig_of(binocular()).views[0]
    text = f'[[view]]\nname = "left"\nfocal_px = {list(view.focal_px)}\ncentre_px = {list(view.centre_px)}\n'
    (tmp_path / "one.toml").write_text(f"{text}{ELASTOMER}young_mpa = 0.3\n", encoding="utf-8")
    words = ("track", made / "layout.json", made / "left", "--contact", made / "gel.npz")
    outputs = ("-o", tmp_path / "a.npz", "--overlay", tmp_path / "a.avi")
    assert run(*words, "--rig", tmp_path / "one.toml", *outputs).exit_code == 0
    assert run(*reconstruct(made, tmp_path / "b.npz")).exit_code == 0
    one, two = loaded(tmp_path / "a.npz"), loaded(tmp_path / "b.npz")
    assert (one["force_n"][0] == 0).all()
    # the scene's dent is steeper than any contact: both are beyond the range
    assert one["contact_reason"][3] == two["contact_reason"][3] == ContactReason.BEYOND_STRAIN
    width = np.sqrt(two["region_area_mm2"][3, 0] / np.pi) / 4.0
    ends = 1 + ForceModel().strain_factor * width * ForceModel().largest_load ** 2
    assert one["force_n"][3, 2] == pytest.approx(two["force_n"][3, 2] / ends, rel=0.15)
    assert "need each other" in refused(*words, "-o", tmp_path / "c.npz")
    several = refused(*words, "--rig", made / "sensor.toml", "-o", tmp_path / "c.npz")
    assert "reconstruct for several views" in several


def test_weights_give_a_modulus_and_bad_files_one_line(made: Path, tmp_path: Path) -> None:
    assert run(*reconstruct(made, tmp_path / "a.npz")).exit_code == 0
    (tmp_path / "weights.csv").write_text("frame,mass_g\n1,20\n3,50\n", encoding="utf-8")
    assert "3 or more" in refused("calibrate", "force", tmp_path / "a.npz", tmp_path / "weights.csv")
    (tmp_path / "weights.csv").write_text("frame,mass_g\n99,20\n", encoding="utf-8")
    assert "frame 99" in refused("calibrate", "force", tmp_path / "a.npz", tmp_path / "weights.csv")
    assert "young_mpa" in refused(*reconstruct(made, tmp_path / "c.npz", rig="soft.toml"))
    assert "calibrate gel" in refused(*reconstruct(made, tmp_path / "c.npz", gel="layout.json"))
    assert not (tmp_path / "c.npz").exists()
