"""From a sensor's files to forces in tables: ``calibrate gel``, ``reconstruct --contact``, ``calibrate force``."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.command import refused, run
from tests.support.tracking.press import write_press

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


def test_weights_give_a_modulus_and_bad_files_one_line(made: Path, tmp_path: Path) -> None:
    assert run(*reconstruct(made, tmp_path / "a.npz")).exit_code == 0
    (tmp_path / "weights.csv").write_text("frame,mass_g\n1,20\n3,50\n", encoding="utf-8")
    assert "3 or more" in refused("calibrate", "force", tmp_path / "a.npz", tmp_path / "weights.csv")
    (tmp_path / "weights.csv").write_text("frame,mass_g\n99,20\n", encoding="utf-8")
    assert "frame 99" in refused("calibrate", "force", tmp_path / "a.npz", tmp_path / "weights.csv")
    assert "young_mpa" in refused(*reconstruct(made, tmp_path / "c.npz", rig="soft.toml"))
    assert "calibrate gel" in refused(*reconstruct(made, tmp_path / "c.npz", gel="layout.json"))
    assert not (tmp_path / "c.npz").exists()
