"""Files of Rerun, and its live server, read by Rerun's own loader and program: every number is that of the table."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk, of some 500 MB, is not installed: pip install '.[rerun]'")

from rerun.chunk import RrdReader

from cmpdesign.tracking.recording.frames import FrameReader
from cmpdesign.tracking.recording.options import RecordedTable, Recording
from cmpdesign.tracking.table import TrackTable
from extractor import Tracker, load_layout
from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, MARKERS, loaded, tracked, write_moving_pattern
from tests.support.tracking.foxglove_client import free_port
from tests.support.tracking.press import write_press

Rows = dict[str, dict[str, list[Any]]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def read_rrd(path: Path) -> Rows:
    """The values of each component of each entity, row by row, with the two timelines."""
    found: Rows = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            values = batch.column(name).to_numpy(zero_copy_only=False)
            found.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(values)
    return found


def numbers(rows: dict[str, list[Any]], name: str) -> np.ndarray:
    """(F, M) or (F, M, K) of a component."""
    return np.array([[np.asarray(value) for value in row] for row in rows[name]])


def test_a_tracked_run_is_read_back_bit_for_bit(made: Path, tmp_path: Path) -> None:
    table = tracked(made, "video.avi", tmp_path / "a.npz")
    result = run("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.rrd", "--with-images")
    assert result.exit_code == 0 and "a.rrd\n" in result.stdout
    entities = read_rrd(tmp_path / "a.rrd")
    markers = entities["/tactile/markers"]
    assert markers["frame"] == list(range(FRAMES))
    times = np.array(markers["time"]).astype("timedelta64[ns]").astype(int)
    assert times.tolist() == [round(t * 1e9) for t in table["time_s"].tolist()]
    np.testing.assert_array_equal(
        numbers(markers, "cmpdesign.Markers:id"), np.tile(np.arange(MARKERS), (FRAMES, 1))
    )
    for name, values in (
        ("status", table["status"]),
        ("xy_px", table["xy_px"].astype("f4")),
        ("displacement_px", table["displacement_px"].astype("f4")),
        ("covariance_px2", table["cov_px2"]),
    ):
        np.testing.assert_array_equal(numbers(markers, f"cmpdesign.Markers:{name}"), values)
    moved = numbers(markers, "cmpdesign.Markers:displacement")
    np.testing.assert_array_equal(moved[..., :2], (1e-3 * table["displacement_mm"]).astype("f4"))
    places = numbers(markers, "Points3D:positions")
    np.testing.assert_allclose(places[0, :, :2], 1e-3 * table["layout_xy_mm"], atol=2e-5)
    arrows = entities["/tactile/displacement"]
    np.testing.assert_array_equal(numbers(arrows, "Arrows3D:vectors"), moved)
    for index, blob in enumerate(entities["/tactile/image_raw"]["EncodedImage:blob"]):
        pixels = cv2.imdecode(np.asarray(blob[0], np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(pixels, cv2.imread(str(made / "frames" / f"frame{index}.png")))


def test_a_reconstructed_run_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    """The third frame is lost: its markers are NaN, and an error gives the reason."""
    press = write_press(tmp_path)
    for name in ("a.npz", "a.rrd"):
        command = ("reconstruct", press / "layout.json", press / "rig.toml", "0", press / "frames")
        assert run(*command, "-o", tmp_path / name).exit_code == 0
    table, entities = loaded(tmp_path / "a.npz"), read_rrd(tmp_path / "a.rrd")
    markers, count = entities["/tactile/markers"], len(table["layer"])
    for name, array, factor in (
        ("Points3D:positions", "3D_Positions", 1e-3),
        ("cmpdesign.Markers:displacement", "3D_Displacements", 1e-3),
        ("cmpdesign.Markers:normal", "3D_Normals", 1.0),
        ("cmpdesign.Markers:covariance", "cov_mm2", 1e-6),
    ):
        values = (table[array][:, :count].astype(float) * factor).astype("f4")
        np.testing.assert_array_equal(numbers(markers, name), values)
    assert np.isnan(numbers(markers, "Points3D:positions")[2]).all()
    log = entities["/diagnostics"]
    assert log["TextLog:level"][2] == ["ERROR"] and log["TextLog:text"][2][0].startswith("lost: ")
    assert len(entities["/tactile/displacement"]["Arrows3D:vectors"][2]) == 0


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (400000, 400000))
from cmpdesign.cli import main
main()
"""


def test_what_does_not_fit_is_kept_in_pieces_and_recovered(made: Path, tmp_path: Path) -> None:
    arguments = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.rrd")
    command = [sys.executable, "-c", LIMITED, *map(str, arguments), "--with-images"]
    limited = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert limited.returncode == 2 and f"{FRAMES} frames are kept in" in limited.stderr, limited.stderr
    assert len(limited.stderr.splitlines()) == 1
    assert not (tmp_path / "a.rrd").exists() and "--recover" in refused(*arguments)
    result = run(*arguments, "--recover")
    assert result.exit_code == 0 and f"{FRAMES} frames recovered" in result.stdout
    assert len(read_rrd(tmp_path / "a.rrd")["/tactile/image_raw"]["frame"]) == FRAMES


@pytest.mark.slow
def test_reruns_own_program_takes_the_live_frames(made: Path, tmp_path: Path) -> None:
    """A viewer that comes later gets the frames before, as they were sent."""
    from cmpdesign.tracking.live.rerun_server import RerunServer

    tracker = Tracker(load_layout(made / "layout.json"))
    frames = [
        tracker.track(cv2.imread(str(made / "frames" / f"frame{k}.png")), time_s=k / 25) for k in range(5)
    ]
    table = RecordedTable(TrackTable(tracker), Recording())
    server = RerunServer("tactile", free_port())
    for frame in frames:
        columns = table.batch([frame])
        server.send(list(FrameReader().frames(columns, table.about(), lambda *_: None)))
    saved = tmp_path / "live.rrd"
    viewer = subprocess.Popen(
        [sys.executable, "-m", "rerun", "--port", str(free_port()), "--save", str(saved), server.address],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    with pytest.raises(subprocess.TimeoutExpired):
        viewer.wait(6)
    server.close()
    viewer.kill()  # it waits for the server to come back
    viewer.wait(30)
    with pytest.warns(match="no footer"):
        markers = read_rrd(saved)["/tactile/markers"]
    assert markers["frame"] == list(range(5))
    xy_px = np.stack([frame.markers.xy_px for frame in frames]).astype("f4")
    np.testing.assert_array_equal(numbers(markers, "cmpdesign.Markers:xy_px"), xy_px)
