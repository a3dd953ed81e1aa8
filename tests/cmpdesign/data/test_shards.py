"""Shards: the content is true, and a shard is complete or absent, in any order of making."""

from __future__ import annotations

import io
import json
import re
import resource
import shutil
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet
import pytest

from cmpdesign import CmpDesignError, InputError, OutputError
from cmpdesign.data import load
from cmpdesign.data.folder import write_manifest
from cmpdesign.data.schedule.processes import installed_versions, require_versions
from cmpdesign.data.shard import make_shard
from cmpdesign.reading.read_layout import layout_from_reference
from cmpdesign.scene import render
from cmpdesign.scene.files.scene_file import scene_from_document
from tests.support.command import refused, run
from tests.support.made.datasets import contents, make_serially, write_plan


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of 4 frames in 2 shards, as PNG."""
    folder = tmp_path_factory.mktemp("serial")
    return make_serially(write_plan(folder), folder / "made")


@pytest.fixture
def unfinished(made: Path, tmp_path: Path) -> Path:
    """The same data set without its last shard."""
    folder = tmp_path / "data"
    shutil.copytree(made, folder)
    for path in (*folder.glob("*/000001.*"), folder / "manifest.json"):
        path.unlink()
    return folder


# -- what is in them


def test_a_frame_is_the_scene_that_its_parameters_say(made: Path) -> None:
    frames = load(made)
    layout = layout_from_reference(frames.layouts["small"])
    for frame in frames:
        solved = next(scene_from_document(frame.parameters, made / "scene", layout).solved_scenes())
        rendered = render(solved.scene, size=(200, 180))
        np.testing.assert_array_equal(frame.image, rendered.image)
        np.testing.assert_allclose(
            frame.arrays["true_xy_px"][0], rendered.truth.marker_xy_px, atol=1e-5, rtol=0
        )
        np.testing.assert_array_equal(frame.arrays["visible"][0], rendered.truth.visible)
        np.testing.assert_allclose(
            frame.arrays["true_xyz_mm"], rendered.truth.marker_xyz_mm, atol=1e-6, rtol=0
        )
        assert solved.contact is not None
        assert frame.values["force_n"] == solved.contact.force_n.tolist() and frame.values["force_n"][2] < 0
        assert frame.values["contact_mm2"] > 0.5 and frame.values["slipping_mm2"] >= 0


def test_the_markers_are_those_of_the_picture(made: Path) -> None:
    for frame in load(made):
        error_px = (frame.arrays["xy_px"] - frame.arrays["true_xy_px"])[frame.arrays["status"] == 1]
        assert len(error_px) > 30 and np.sqrt(np.mean(error_px**2)) < 0.1
        moved_px = np.linalg.norm(frame.arrays["true_xy_px"] - frame.arrays["rest_xy_px"], axis=-1)
        assert 0.02 < moved_px.max() < 10 and np.median(moved_px) < moved_px.max()
        assert frame.values["reason"] == [""]


def test_frames_differ_and_their_values_are_in_columns(made: Path) -> None:
    table = load(made).table(
        ["frame", "scene.contact.motion.press_mm", "scene.sensor.noise", "scene.damage.blobs.count"]
    )
    columns = table.to_pydict()
    assert columns["frame"] == [0, 1, 2, 3]
    presses = columns["scene.contact.motion.press_mm"]
    assert len(set(presses)) == 4 and all(0.1 <= press <= 0.3 for press in presses)
    for frame, press, noise in zip(load(made), presses, columns["scene.sensor.noise"], strict=True):
        assert frame.parameters["contact"]["motion"]["press_mm"] == press
        assert frame.parameters["sensor"]["noise"] == noise
        assert len(frame.parameters["damage"]["blobs"]) == frame.values["scene.damage.blobs.count"]


def test_other_programs_read_tar_and_parquet(made: Path) -> None:
    """As WebDataset does: the names before the first dot group the files of a sample."""
    row = 0
    table = pyarrow.parquet.read_table(made / "tables" / "000001.parquet").to_pylist()
    with tarfile.open(made / "images" / "000001.tar") as tar:
        members = tar.getmembers()
        assert [member.name for member in members] == [
            f"{key}.{ending}" for key in ("000000002", "000000003") for ending in ("json", "png")
        ]
        assert {(member.mtime, member.uid, member.uname, member.mode) for member in members} == {
            (0, 0, "", 0o644)
        }
        for label, picture in zip(members[::2], members[1::2], strict=True):
            said = json.load(tar.extractfile(label) or io.BytesIO())
            image = cv2.imdecode(
                np.frombuffer((tar.extractfile(picture) or io.BytesIO()).read(), np.uint8), 1
            )
            assert image is not None and image.shape == (180, 200, 3)
            assert (
                said["force_n"] == table[row]["force_n"] and said["frame"] == table[row]["frame"] == 2 + row
            )
            row += 1
    assert row == 2


def test_jpeg_keeps_the_resolution_of_color(tmp_path: Path) -> None:
    """The sampling factors in the file are 1 x 1 for all three components."""
    folder = make_serially(write_plan(tmp_path, frames=1, frames_a_shard=1, kind="jpeg"), tmp_path / "data")
    data = load(folder)[0].image_bytes
    start = data.index(b"\xff\xc0") + 10  # of the frame header: components of id, sampling, table
    assert [data[start + 3 * k + 1] for k in range(3)] == [0x11] * 3
    assert np.isfinite(load(folder)[0].arrays["xy_px"]).mean() > 0.8


VIEWS = """
[[scene.view]]
distance_mm = 40
field_of_view_deg = 30
tilt_deg = {tilt}
back = true
area_px = [{x}, 0, 200, 180]
"""


def test_two_views_in_one_picture_are_read_each(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, frames=1, frames_a_shard=1)
    text = plan.read_text(encoding="utf-8").replace("[200, 180]", "[400, 180]")
    text = re.sub(r"\[scene.camera\]\n.*\n", "", text)
    views = "".join(VIEWS.format(tilt=tilt, x=x) for tilt, x in ((15, 0), (-15, 200)))
    plan.write_text(text + views, encoding="utf-8")
    (frame,) = load(make_serially(plan, tmp_path / "data"))
    assert frame.values["views"] == 2 and frame.image.shape == (180, 400, 3)
    assert {name: values.shape for name, values in frame.arrays.items()} == {
        "rest_xy_px": (2, 37, 2),
        "true_xy_px": (2, 37, 2),
        "visible": (2, 37),
        "true_xyz_mm": (37, 3),
        "xy_px": (2, 37, 2),
        "cov_px2": (2, 37, 3),
        "status": (2, 37),
    }
    error_px = frame.arrays["xy_px"] - frame.arrays["true_xy_px"]
    assert frame.values["reason"] == ["", ""] and np.nanmax(np.abs(error_px)) < 0.5
    assert (frame.arrays["xy_px"][0, :, 0] < 200).all() and (frame.arrays["xy_px"][1, :, 0] > 200).all()


def test_contacts_beyond_the_strain_are_drawn_anew(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, frames=2)
    text = plan.read_text(encoding="utf-8")
    plan.write_text(text.replace("frames = 2", "largest_strain = 0.06\nframes = 2", 1), encoding="utf-8")
    frames = load(make_serially(plan, tmp_path / "data"))
    assert all(frame.values["largest_strain"] <= 0.06 for frame in frames)
    assert sum(frame.values["redrawn"] for frame in frames) > 0
    plan.write_text(text.replace("frames = 2", "largest_strain = 1e-6\nframes = 2", 1), encoding="utf-8")
    line = refused("dataset", plan, "-o", tmp_path / "none", "--workers", 1)
    assert "frame 0: none of 20 draws can be rendered" in line and "the plan's limit 1e-06" in line
    assert "narrow the plan's ranges" in line and not list((tmp_path / "none").glob("*/0*"))


def test_places_and_iteration_agree(made: Path) -> None:
    frames = load(made)
    assert len(frames) == 4 and frames.complete and frames.shards == (0, 1)
    for place, frame in enumerate(frames):
        assert frames[place].image_bytes == frame.image_bytes
        assert frames[place].values == frame.values == frames[place - 4].values
    with pytest.raises(IndexError, match="frame 4: the data set has 4 frames"):
        frames[4]
    assert [frame.values["frame"] for frame in frames.frames([1])] == [2, 3]


# -- whole or not there


def test_any_order_gives_the_same_bytes(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(made, folder, ignore=shutil.ignore_patterns("0*", "manifest.json"))
    for number in (1, 0, 1):
        make_shard(str(folder), number)
    write_manifest(folder)
    assert contents(folder) == contents(made)


def test_two_workers_give_the_same_bytes(made: Path, tmp_path: Path) -> None:
    """Each run is a separate process, from the command line."""
    result = run("dataset", write_plan(tmp_path), "-o", tmp_path / "data", "--workers", 2)
    assert result.exit_code == 0, result.output
    assert "frames 4 shards 2" in " ".join(result.stdout.split())
    assert contents(tmp_path / "data") == contents(made)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Within this context, the system limits the size of files that this process writes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("size", [0, 2000, 30_000, 100_000])
def test_where_no_more_can_be_written_nothing_is_half_written(
    made: Path, unfinished: Path, size: int
) -> None:
    """The limits stop the tar file at once, in its first picture, in a later one, or the table."""
    before = contents(unfinished)
    with (
        largest_file(size),
        pytest.raises(OutputError, match=r"shard 1 cannot be written \(File too large\)"),
    ):
        make_shard(str(unfinished), 1)
    assert contents(unfinished) == before
    make_shard(str(unfinished), 1)
    write_manifest(unfinished)
    assert contents(unfinished) == contents(made)


@pytest.mark.parametrize("name", ["images/000001.tar", "tables/000001.parquet", "shards/000001.json"])
@pytest.mark.parametrize("harm", ["gone", "cut"])
def test_a_harmed_shard_is_made_again(made: Path, tmp_path: Path, name: str, harm: str) -> None:
    folder = tmp_path / "data"
    shutil.copytree(made, folder)
    path = folder / name
    if harm == "gone":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:-7])
    make_shard(str(folder), 1)
    assert contents(folder) == contents(made)


def test_an_unfinished_data_set_is_read_as_far_as_it_goes(unfinished: Path) -> None:
    frames = load(unfinished)
    assert not frames.complete and frames.shards == (0,) and len(frames) == 2
    assert repr(frames) == "<DataSet: 2 frames in 1 of 2 shards>"


def test_a_changed_plan_is_noticed(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(made, folder)
    other = write_plan(tmp_path, frames_a_shard=4)
    assert "holds a data set of another plan" in refused("dataset", other, "-o", folder)
    plan = folder / "plan.json"
    plan.write_text(plan.read_text(encoding="utf-8").replace('"seed": 0', '"seed": 1'), encoding="utf-8")
    assert "plan.json was changed" in refused("dataset", write_plan(tmp_path), "-o", folder)


def test_damage_is_told_with_what_helps(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(made, folder)
    (folder / "tables" / "000001.parquet").write_bytes(b"no table")
    with pytest.raises(InputError, match=r"000001.parquet: cannot be read \(.*makes the shard again"):
        load(folder)[2]
    (folder / "images" / "000000.tar").write_bytes(b"no tar" * 200)
    with pytest.raises(InputError, match=r"000000.tar is no tar file"):
        load(folder)[0]
    for text in ("{}", "[1]", "no JSON", '{"plan": "other", "shards": [{"shard": "../../x"}]}'):
        (folder / "manifest.json").write_text(text, encoding="utf-8")
        assert load(folder).shards == ()
    shutil.copy(made / "manifest.json", folder)
    assert load(folder).shards == (0, 1)
    with pytest.raises(CmpDesignError, match=r"holds no plan.json; give the folder of cmpdesign dataset"):
        load(tmp_path)


def test_a_worker_with_other_versions_is_refused() -> None:
    versions = installed_versions()
    require_versions(versions)
    with pytest.raises(CmpDesignError, match=r"a worker has numpy .*, this program 0\.1; install the same"):
        require_versions(versions | {"numpy": "0.1"})
