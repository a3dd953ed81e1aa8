"""Recordings, opened by readers of ROS 2 messages that are not ours: every number is that of the table."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, MARKERS, loaded, tracked, write_moving_pattern
from tests.support.tracking.messages import Messages, points_of, read_messages
from tests.support.tracking.press import write_press
from tests.support.view_scenes import HALF, binocular, rig_of


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_press(tmp_path_factory.mktemp("press"))


def recorded(
    made: Path, output: Path, *options: object, source: str = "video.avi", code: int = 0
) -> Messages:
    result = run("track", made / "layout.json", made / source, "-o", output, *options)
    assert result.exit_code == code, result.output
    return read_messages(output)


def test_a_tracked_run_is_read_back_bit_for_bit(made: Path, tmp_path: Path) -> None:
    table = tracked(made, "video.avi", tmp_path / "a.npz")
    messages = recorded(made, tmp_path / "a.mcap")
    assert set(messages) == {"/tactile/markers", "/diagnostics"}
    clouds = messages["/tactile/markers"]
    assert len(clouds) == FRAMES and clouds[0].decoded_message.header.frame_id == "tactile"
    assert [one.message.log_time for one in clouds] == [round(t * 1e9) for t in table["time_s"].tolist()]
    points = np.stack([points_of(one) for one in clouds])
    np.testing.assert_array_equal(points["id"][..., 0], np.tile(np.arange(MARKERS), (FRAMES, 1)))
    np.testing.assert_array_equal(points["status"][..., 0], table["status"])
    for names, values in (
        (("x_px", "y_px"), table["xy_px"]),
        (("dx_px", "dy_px"), table["displacement_px"]),
        (("dx", "dy"), 1e-3 * table["displacement_mm"]),
    ):
        for k, name in enumerate(names):
            np.testing.assert_array_equal(points[name][..., 0], values[..., k].astype("f4"))
    np.testing.assert_array_equal(points["covariance_px2"], table["cov_px2"])
    assert not points["z"].any() and not points["dz"].any()
    # at rest the markers lie in the layout's frame; what they have moved is the displacement
    np.testing.assert_allclose(points["x"][0, :, 0], 1e-3 * table["layout_xy_mm"][:, 0], atol=2e-5)
    moved = points["x"][..., 0] - points["x"][0, :, 0]
    np.testing.assert_allclose(moved, points["dx"][..., 0], atol=1e-8)
    assert sorted(path.name for path in tmp_path.glob("a.mcap*")) == ["a.mcap", "a.mcap.summary.json"]


def test_a_scale_gives_metres_along_the_images_axes(made: Path, tmp_path: Path) -> None:
    messages = recorded(made, tmp_path / "a.mcap", "--mm-per-px", "0.1", "--frames", "2")
    points = points_of(messages["/tactile/markers"][1])
    np.testing.assert_allclose(points["x"], 1e-4 * points["x_px"], rtol=1e-6)
    np.testing.assert_allclose(points["y"], -1e-4 * points["y_px"], rtol=1e-6)
    np.testing.assert_allclose(points["dy"], -1e-4 * points["dy_px"], rtol=1e-5, atol=1e-12)


def test_images_are_the_sources_pixels(made: Path, tmp_path: Path) -> None:
    messages = recorded(
        made, tmp_path / "a.mcap", "--with-images", "--frame-id", "finger/left", "--fps", "7", source="frames"
    )
    assert set(messages) == {
        "/finger/left/markers",
        "/finger/left/image_raw/compressed",
        "/finger/left/camera_info",
        "/diagnostics",
    }
    images, cameras = messages["/finger/left/image_raw/compressed"], messages["/finger/left/camera_info"]
    assert len(images) == len(cameras) == FRAMES
    for index, (image, camera) in enumerate(zip(images, cameras, strict=True)):
        pixels = cv2.imdecode(np.frombuffer(image.decoded_message.data, np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(pixels, cv2.imread(str(made / "frames" / f"frame{index}.png")))
        assert image.decoded_message.format == "png" and image.message.log_time == round(index / 7 * 1e9)
        info = camera.decoded_message
        assert (info.height, info.width) == pixels.shape[:2] and not any(info.k)  # 0: not calibrated
        assert info.header.frame_id == image.decoded_message.header.frame_id == "finger_left_camera"


def test_diagnostics_say_what_is_wrong(made: Path, tmp_path: Path) -> None:
    """A black frame between two good ones: an error with its reason; its points are there, and NaN."""
    (tmp_path / "frames").mkdir()
    good = cv2.imread(str(made / "frames" / "frame0.png"))
    assert good is not None
    for index, image in enumerate((good, np.zeros_like(good), good)):
        cv2.imwrite(str(tmp_path / "frames" / f"{index}.png"), image)
    messages = recorded(made, tmp_path / "a.mcap", source=str(tmp_path / "frames"))
    statuses = [one.decoded_message.status[0] for one in messages["/diagnostics"]]
    values = [{pair.key: pair.value for pair in status.values} for status in statuses]
    assert [int(status.level) for status in statuses] == [0, 2, 0]
    assert [status.message for status in statuses][::2] == ["tracked", "tracked"]
    assert statuses[1].message.startswith("lost: ") and values[1]["reason"] in statuses[1].message
    assert [one["frame"] for one in values] == ["0", "1", "2"] and values[1]["markers_lost"] == str(MARKERS)
    assert values[0]["markers_measured"] == str(MARKERS) and values[0]["start"] == "cold"
    assert 8 < float(values[0]["edge_px"]) < 100 and 0 < float(values[0]["noise"]) < 15
    points = points_of(messages["/tactile/markers"][1])
    assert len(points) == MARKERS and not points["status"].any()
    assert all(np.isnan(points[name]).all() for name in ("x", "y", "z", "dx", "dz", "x_px", "covariance_px2"))


def reconstructed(press: Path, output: Path, *options: object, source: str = "frames") -> None:
    command = ("reconstruct", press / "layout.json", press / "rig.toml", "0", press / source, "-o", output)
    result = run(*command, *options)
    assert result.exit_code == 0, result.output


def test_a_reconstructed_run_is_read_back_bit_for_bit(press: Path, tmp_path: Path) -> None:
    for name in ("a.npz", "a.mcap"):
        options = ("--with-images",) if name == "a.mcap" else ()
        reconstructed(press, tmp_path / name, *options)
    table, messages = loaded(tmp_path / "a.npz"), read_messages(tmp_path / "a.mcap")
    points = np.stack([points_of(one) for one in messages["/tactile/markers"]])
    count = len(table["layer"])
    assert points.shape == (len(table["frame"]), count)
    for names, array in (
        ("xyz", "3D_Positions"),
        (("dx", "dy", "dz"), "3D_Displacements"),
        (("nx", "ny", "nz"), "3D_Normals"),
    ):
        for k, name in enumerate(names):
            factor = 1.0 if name.startswith("n") else 1e-3
            values = (table[array][:, :count, k].astype(float) * factor).astype("f4")
            np.testing.assert_array_equal(points[name][..., 0], values)
    covariance = (table["cov_mm2"][:, :count].astype(float) * 1e-6).astype("f4")
    np.testing.assert_array_equal(points["covariance"], covariance)
    assert np.isnan(points["z"][2]).all() and np.isfinite(points["z"][[0, 1, 3]]).all()
    levels = [int(one.decoded_message.status[0].level) for one in messages["/diagnostics"]]
    assert levels[2] == 2
    keys = {pair.key for pair in messages["/diagnostics"][0].decoded_message.status[0].values}
    assert {"left.noise", "right.blur_px"} <= keys


def test_cameras_have_the_rigs_intrinsics(press: Path, tmp_path: Path) -> None:
    """One image with two views has two cameras; two images have one each."""
    from extractor import load_rig

    rig = load_rig(press / "rig.toml")
    reconstructed(press, tmp_path / "a.mcap", "--with-images", "--frames", "1")
    messages = read_messages(tmp_path / "a.mcap")
    assert len(messages["/tactile/image_raw/compressed"]) == 1
    for view in rig.views:
        info = messages[f"/tactile/{view.name}/camera_info"][0].decoded_message
        assert (info.k[0], info.k[4], info.k[2], info.k[5]) == (*view.focal_px, *view.centre_px)
        assert tuple(info.d) == view.distortion and info.distortion_model == "plumb_bob"
        area = (info.roi.x_offset, info.roi.y_offset, info.roi.width, info.roi.height)
        assert area == view.area_px


def test_a_folder_is_a_rosbag(made: Path, tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    result = run("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "run_bag/")
    assert result.exit_code == 0 and f"wrote {tmp_path / 'run_bag'}\n" in result.stdout
    assert sorted(path.name for path in (tmp_path / "run_bag").iterdir()) == ["metadata.yaml", "run_bag.mcap"]
    assert "storage_identifier: mcap" in (tmp_path / "run_bag" / "metadata.yaml").read_text()
    assert len(read_messages(tmp_path / "run_bag" / "run_bag.mcap")["/tactile/markers"]) == FRAMES
    with AnyReader([tmp_path / "run_bag"]) as reader:
        counts = {one.topic: one.msgcount for one in reader.connections}
        assert counts == {"/tactile/markers": FRAMES, "/diagnostics": FRAMES}
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    before = sorted(tmp_path.rglob("*"))
    line = refused("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "run_bag/")
    assert "is a folder" in line and sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("output", "options", "expected"),
    [
        ("a.npz", ("--with-images",), "--with-images: "),
        ("a.mcap", ("--frame-id", "my frame"), "--frame-id 'my frame': cannot stand in a ROS topic"),
        ("a.bag", (), "or none for a rosbag2 folder"),
    ],
)
def test_bad_options_are_one_line_and_no_file(
    output: str, options: tuple[str, ...], expected: str, made: Path, tmp_path: Path
) -> None:
    line = refused("track", made / "layout.json", made / "video.avi", "-o", tmp_path / output, *options)
    assert expected in line and list(tmp_path.iterdir()) == []


def test_without_rosbags_one_line_says_how_to_get_it(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    line = refused("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.mcap")
    assert "of the extra [recording]" in line and list(tmp_path.iterdir()) == []


def test_views_with_an_image_each_have_their_own_topics(press: Path, tmp_path: Path) -> None:
    """Two sources, the second one frame short of an image: that frame has the other view's image alone."""
    views = rig_of(binocular()).views
    text = "".join(
        f'[[view]]\nname = "{view.name}"\nfocal_px = {list(view.focal_px)}\ndistortion = {list(view.distortion)}\n'
        f"centre_px = {[view.centre_px[0] - k * HALF[0], view.centre_px[1]]}\n"
        for k, view in enumerate(views)
    )
    (tmp_path / "two.toml").write_text(text, encoding="utf-8")
    (tmp_path / "right").mkdir()
    for name in ("0.png", "1.png"):
        data = (press / "right" / name).read_bytes()
        (tmp_path / "right" / name).write_bytes(data if name == "0.png" else data[: len(data) // 2])
    sources = f"{press / 'left'},{tmp_path / 'right'}"
    command = ("reconstruct", press / "layout.json", tmp_path / "two.toml", "0", sources)
    result = run(*command, "-o", tmp_path / "a.mcap", "--with-images", "--frames", "2")
    assert result.exit_code == 0, result.output
    messages = read_messages(tmp_path / "a.mcap")
    for view, count in (("left", 2), ("right", 1)):
        images = messages[f"/tactile/{view}/image_raw/compressed"]
        assert len(images) == len(messages[f"/tactile/{view}/camera_info"]) == count
        pixels = cv2.imdecode(np.frombuffer(images[0].decoded_message.data, np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(pixels, cv2.imread(str(press / view / "0.png")))
    assert "/tactile/image_raw/compressed" not in messages
