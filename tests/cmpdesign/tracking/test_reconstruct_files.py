"""``cmpdesign reconstruct`` on real files: tables agree with each other and the truth, bad input is refused."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cmpdesign.scene import Medium, render
from tests.support.command import refused, run
from tests.support.tracking.press import FRAMES, seen_from_the_back, write_press
from tests.support.view_scenes import (
    HALF,
    SMALL,
    binocular,
    binocular_scene,
    contact,
    reference,
    rig_of,
    rig_text,
)

LAYOUT = reference(layers=SMALL)
MARKERS = len(LAYOUT.xy_mm)
POINTS = MARKERS + len(LAYOUT.edges) * LAYOUT.virtual_per_edge


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_press(tmp_path_factory.mktemp("made"))


def arrays(made: Path, output: Path, *options: object, source: str = "frames") -> dict[str, np.ndarray]:
    command = (
        "reconstruct",
        made / "layout.json",
        made / "rig.toml",
        "0",
        made / source,
        "-o",
        output,
        *options,
    )
    result = run(*command)
    assert result.exit_code == 0, result.output
    with np.load(output, allow_pickle=False) as file:
        return dict(file)


def test_arrays_hold_the_surface_in_micrometres(made: Path, tmp_path: Path) -> None:
    table, truth = arrays(made, tmp_path / "a.npz", "--fps", "10"), np.load(made / "truth.npy")
    for name in ("3D_Positions", "3D_Displacements", "3D_Normals"):
        assert table[name].shape == (FRAMES, POINTS, 3) and table[name].dtype == np.float32
    seen = [0, 1, 3]
    for values, true in ((table["3D_Positions"], truth), (table["3D_Displacements"], truth - truth[0])):
        assert np.sqrt(np.nanmean((values - true)[seen] ** 2)) < 0.0015
        assert np.isfinite(values[seen]).all()
    np.testing.assert_allclose(np.linalg.norm(table["3D_Normals"][seen], axis=2), 1, atol=1e-5)
    sigma = np.sqrt(table["cov_mm2"][seen][:, :MARKERS, [0, 3, 5]])
    error = (table["3D_Positions"] - truth)[seen][:, :MARKERS]
    assert 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.5
    assert table["frame_status"].tolist() == [1, 1, 2, 1] and np.isnan(table["3D_Positions"][2]).all()
    assert table["reason"][2].startswith("right: no_") and not table["reason"][[0, 1, 3]].any()
    assert (table["point_reason"][2, :MARKERS] == 2).all() and not table["status"][2].any()
    np.testing.assert_allclose(table["time_s"], np.arange(FRAMES) / 10)
    np.testing.assert_allclose(table["rest_positions_mm"], truth[0], atol=0.01)
    assert table["edge"].tolist() == [-1] * MARKERS + np.repeat(np.arange(len(LAYOUT.edges)), 5).tolist()
    assert str(table["format"]) == "cmp-reconstruction" and table["views"].tolist() == ["left", "right"]
    for camera, rotation in zip(binocular(), table["R_camera_from_layout"], strict=True):
        np.testing.assert_allclose(rotation, camera.R_camera_from_layout, atol=1e-3)


def test_views_are_read_by_their_response(made: Path, tmp_path: Path) -> None:
    """The frames are sRGB: read as linear, the rest image and every frame are worse."""
    truth = np.load(made / "truth.npy")

    def errors(*options: object) -> tuple[float, float]:
        positions = arrays(made, tmp_path / "a.npz", "--frames", "2", *options)["3D_Positions"]
        summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
        rest_px = float(np.mean([view["rms_px"] for view in summary["views"]]))
        return rest_px, float(np.sqrt(np.nanmean((positions - truth[:2]) ** 2)))

    usual, wrong = errors(), errors("--response", "linear")
    assert errors("--response", "srgb") == usual
    assert wrong[0] > 1.5 * usual[0] and wrong[1] > 1.5 * usual[1]


def test_all_tables_say_the_same(made: Path, tmp_path: Path) -> None:
    import pyarrow.parquet as pyarrow

    table = arrays(made, tmp_path / "a.npz")
    for name in ("b.csv", "c.parquet"):
        command = (
            "reconstruct",
            made / "layout.json",
            made / "rig.toml",
            "0",
            made / "frames",
            "-o",
            tmp_path / name,
        )
        assert run(*command).exit_code == 0
    parquet = pyarrow.read_table(tmp_path / "c.parquet")
    with (tmp_path / "b.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == parquet.column_names and len(rows) == parquet.num_rows == FRAMES * POINTS
    for name, column in (
        ("z_mm", table["3D_Positions"][..., 2]),
        ("dx_mm", table["3D_Displacements"][..., 0]),
        ("ny", table["3D_Normals"][..., 1]),
        ("cov_zz_mm2", table["cov_mm2"][..., 5]),
        ("point_reason", table["point_reason"]),
    ):
        text = np.array([float(row[name] or "nan") for row in rows]).reshape(FRAMES, POINTS)
        np.testing.assert_allclose(text, column, atol=1e-6)
        np.testing.assert_array_equal(parquet[name].to_numpy().reshape(FRAMES, POINTS), column)
    assert {row["frame_status"] for row in rows} == {"tracked", "lost"}
    assert [row["point"] for row in rows[:3]] == ["0", "1", "2"] and rows[MARKERS]["edge"] == "0"


def test_the_summary_counts(made: Path, tmp_path: Path) -> None:
    arrays(made, tmp_path / "a.npz")
    summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
    assert summary["frames"] == {
        "declared": 4, "read": 4, "tracked": 3, "lost": 1, "unreadable": 0, "other_size": 0
    }  # fmt: skip
    assert summary["positions"] == {"of": "pattern", "depth_mm": None, "continued_to_surface": False}
    assert summary["marker_shares"] == {"measured": 0.75, "repaired": 0.0, "lost": 0.25}
    assert summary["lost_markers"] == {"one_view": MARKERS}
    assert 0.1 < summary["sigma_um"][2] < 2 and summary["largest_displacement"]["mm"] == pytest.approx(
        1.63, abs=0.1
    )
    assert [view["name"] for view in summary["views"]] == ["left", "right"]
    assert all(view["rms_px"] < 0.02 and view["position_mm"][2] < 0 for view in summary["views"])


MEDIUM = "[medium]\ngel_mm = 4.0\ngel_index = 1.41\nwindow_mm = 2.0\nwindow_index = 1.49\n"


def test_the_rig_files_medium_is_what_the_cameras_look_through(tmp_path: Path) -> None:
    """Frames through gel and window: right with the rig's medium, too shallow and warned about without."""
    (tmp_path / "layout.json").write_text(seen_from_the_back(), encoding="utf-8")
    rig = rig_text(rig_of(binocular()))
    (tmp_path / "frames").mkdir()
    for k, surface in enumerate((None, contact)):
        scene = replace(binocular_scene(surface, 60 + k), medium=Medium(4.0, 1.41, 2.0, 1.49))
        shot = render(scene, size=(2 * HALF[0], HALF[1]))
        cv2.imwrite(str(tmp_path / "frames" / f"{k}.png"), shot.image)
    true_mm = shot.truth.marker_xyz_mm
    deepest = true_mm[:, 2].argmin()
    depths_mm, warnings = [], []
    for text in (rig + MEDIUM, rig):
        (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
        command = ("reconstruct", tmp_path / "layout.json", tmp_path / "rig.toml", "0", tmp_path / "frames")
        result = run(*command, "-o", tmp_path / "a.npz")
        assert result.exit_code == 0, result.output
        with np.load(tmp_path / "a.npz") as table:
            depths_mm.append(table["3D_Displacements"][1, deepest, 2])
        summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
        warnings.append(summary["warnings"])
        assert all(f"warning: {line}" in result.output for line in summary["warnings"])
        assert result.output.count("warning:") == len(summary["warnings"])
    assert depths_mm[0] == pytest.approx(true_mm[deepest, 2], rel=0.005)
    assert 0.15 < 1 - depths_mm[1] / true_mm[deepest, 2] < 0.35
    assert not warnings[0] and len(warnings[1]) == 1 and "the rig has no [medium]" in warnings[1][0]


def test_the_touched_surface_is_continued_on_wish(made: Path, tmp_path: Path) -> None:
    rig = (made / "rig.toml").read_text() + '\n[elastomer]\nthickness_mm = 5\nmarker_depth_mm = "1mm"\n'
    (tmp_path / "rig.toml").write_text(rig)
    files = str(made / "layout.json"), str(tmp_path / "rig.toml"), str(made / "frames" / "0.png")
    out = tmp_path / "out.npz"
    result = run("reconstruct", *files, str(made / "frames"), "-o", str(out), "--surface")
    assert result.exit_code in (0, 1), result.output
    assert "of pattern, depth 1 mm, continued to surface yes" in " ".join(result.output.split())
    table = np.load(out)
    pattern, surface = table["3D_Displacements"][:, :MARKERS], table["surface_displacement_mm"]
    assert surface.shape == pattern.shape and (np.isnan(surface) == np.isnan(pattern)).all()
    assert np.nanmax(np.abs(surface - pattern)[0]) < 0.01 and np.nanmax(np.abs(surface - pattern)[1]) > 0.1
    assert np.nanmedian(table["surface_cov_mm2"][..., 5]) > np.nanmedian(table["cov_mm2"][:, :MARKERS, 5])
    assert (
        json.loads((tmp_path / "out.npz.summary.json").read_text())["positions"]["continued_to_surface"]
        is True
    )
    text = tmp_path / "out.csv"
    run("reconstruct", *files, str(made / "frames"), "-o", str(text), "--surface")
    rows = list(csv.DictReader(text.read_text().splitlines()))
    z = np.array([float(row["surface_dz_mm"] or "nan") for row in rows]).reshape(FRAMES, POINTS)
    np.testing.assert_allclose(z[:, :MARKERS], surface[..., 2], atol=1e-6)
    assert np.isnan(z[:, MARKERS:]).all()


def test_without_an_elastomer_no_surface_is_made_up(made: Path, tmp_path: Path) -> None:
    files = str(made / "layout.json"), str(made / "rig.toml"), str(made / "frames" / "0.png")
    out = tmp_path / "out.npz"
    result = run("reconstruct", *files, str(made / "frames"), "-o", str(out), "--surface")
    assert result.exit_code == 2 and "has no [elastomer] with thickness_mm" in " ".join(result.output.split())
    assert not out.exists()


def test_two_cameras_are_two_sources(made: Path, tmp_path: Path) -> None:
    rig = rig_of(binocular())
    text = "".join(
        f'[[view]]\nname = "{view.name}"\nfocal_px = {list(view.focal_px)}\n'
        f"centre_px = {[view.centre_px[0] - k * HALF[0], view.centre_px[1]]}\ndistortion = {list(view.distortion)}\n"
        for k, view in enumerate(rig.views)
    )
    (tmp_path / "two.toml").write_text(text, encoding="utf-8")
    both = f"{made / 'left'},{made / 'right'}"
    command = ("reconstruct", made / "layout.json", tmp_path / "two.toml")
    result = run(*command, "0", both, "-o", tmp_path / "b.npz")
    assert result.exit_code == 0, result.output
    one = arrays(made, tmp_path / "a.npz")
    with np.load(tmp_path / "b.npz") as two:
        np.testing.assert_allclose(two["3D_Positions"], one["3D_Positions"], atol=1e-5)
    rests = f"{made / 'left' / '0.png'},{made / 'right' / '0.png'}"
    assert run(*command, rests, both, "-o", tmp_path / "c.npz", "--frames", "2").exit_code == 0
    (tmp_path / "short").mkdir()
    cv2.imwrite(str(tmp_path / "short" / "0.png"), cv2.imread(str(made / "right" / "0.png")))
    result = run(*command, rests, f"{made / 'left'},{tmp_path / 'short'}", "-o", tmp_path / "d.npz")
    assert result.exit_code == 1 and "short has fewer frames than the others" in result.stderr
    assert "REST lists 3 pictures, SOURCE 2" in refused(*command, "a,b,c", both, "-o", tmp_path / "e.npz")


def test_given_poses_are_kept_or_found_again(made: Path, tmp_path: Path) -> None:
    rig = made / "rig.toml"
    text = rig.read_text(encoding="utf-8").split("[[view]]")
    turned = np.array([[np.cos(0.02), -np.sin(0.02), 0], [np.sin(0.02), np.cos(0.02), 0], [0, 0, 1]])
    tables = [
        f"{table}R_camera_from_layout = {(camera.R_camera_from_layout @ turned).tolist()}\n"
        f"t_camera_from_layout_mm = {camera.t_camera_from_layout_mm.tolist()}\n"
        for table, camera in zip(text[1:], binocular(), strict=True)
    ]
    (tmp_path / "turned.toml").write_text("[[view]]" + "[[view]]".join(tables), encoding="utf-8")
    command = (
        "reconstruct",
        made / "layout.json",
        tmp_path / "turned.toml",
        "0",
        made / "frames",
        "--frames",
        "1",
    )
    found = {}
    for name, options in (("kept", ()), ("found", ("--from-rest",))):
        assert run(*command, "-o", tmp_path / f"{name}.npz", *options).exit_code == 0
        with np.load(tmp_path / f"{name}.npz") as file:
            found[name] = file["R_camera_from_layout"][0]
    true = binocular()[0].R_camera_from_layout
    np.testing.assert_allclose(found["kept"], true @ turned, atol=1e-12)
    np.testing.assert_allclose(found["found"], true, atol=1e-3)


@pytest.mark.parametrize(
    ("rig", "rest", "options", "said"),
    [
        ("missing.toml", "0", (), "missing.toml: cannot be read"),
        ("one.toml", "0", (), "the rig has 1 view; depth needs two or more"),
        ("twins.toml", "0", (), "stand too near to each other to measure depth"),
        ("large.toml", "0", (), "reaches beyond the image of 960 x 360 px"),
        ("mirror.toml", "0", (), "check which views are mirrored"),
        ("rig.toml", "9", (), "has fewer frames"),
        ("rig.toml", "none.png", (), "none.png"),
        ("rig.toml", "2", (), "view 'right' shows no pattern at rest (no_"),
        ("rig.toml", "0", ("--flatness-mm", "-1"), "--flatness-mm is -1; expected a number from 0"),
        ("rig.toml", "0", ("--fps", "0"), "--fps is 0"),
        ("rig.toml", "0", ("-o", "a.txt"), "unknown ending; expected one of .npz, .parquet, .csv"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    rig: str, rest: str, options: tuple[str, ...], said: str, made: Path, tmp_path: Path
) -> None:
    text = (made / "rig.toml").read_text(encoding="utf-8")
    left = text[: text.index('[[view]]\nname = "right"')]
    changed = {
        "one.toml": left,
        "twins.toml": left + left.replace('"left"', '"twin"'),
        "large.toml": text.replace("[480, 0, 480, 360]", "[480, 0, 481, 360]"),
        "mirror.toml": text.replace("mirrored = false", "mirrored = true", 1),
        "rig.toml": text,
    }
    for name, content in changed.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    arguments = (
        "reconstruct",
        made / "layout.json",
        tmp_path / rig,
        rest,
        made / "frames",
        "-o",
        tmp_path / "a.npz",
    )
    assert said in refused(*arguments, *options)
    assert sorted(tmp_path.iterdir()) == before
