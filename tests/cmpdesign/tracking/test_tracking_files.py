"""``cmpdesign track`` on real files: its tables agree, and tracked frames are kept for any end of a run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from cmpdesign.cli import app
from cmpdesign.scene import Sensor, Twist, render
from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, MARKERS, loaded, rows_of, tracked, write_moving_pattern
from tests.support.tracking.scenes import SIZE, reference, scene, shot


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_moving_pattern(tmp_path_factory.mktemp("made"))


def test_a_video_becomes_arrays(made: Path, tmp_path: Path) -> None:
    table = tracked(made, "video.avi", tmp_path / "a.npz")
    truth = np.load(made / "truth.npy")
    assert table["xy_px"].shape == (FRAMES, MARKERS, 2) and table["xy_px"].dtype == np.float64
    assert np.abs(table["xy_px"] - truth).max() < 1.0
    np.testing.assert_array_equal(table["frame"], np.arange(FRAMES))
    np.testing.assert_allclose(table["time_s"], np.arange(FRAMES) / 25, atol=1e-6)
    assert (table["frame_status"] == 1).all() and (table["status"] == 1).all()
    assert table["start"][0] == "cold" and (table["start"][1:] == "warm").all()
    np.testing.assert_allclose(table["displacement_px"], table["xy_px"] - table["rest_xy_px"])
    np.testing.assert_array_equal(table["layout_xy_mm"], reference().xy_mm)
    assert str(table["digest"]) == reference().digest
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "a.npz.summary.json"]


def test_frames_are_read_by_their_response(made: Path, tmp_path: Path) -> None:
    """Linear frames, at rest and moved by a twist: positions and displacement are right once the response is told."""
    scenes = [
        scene(sensor=Sensor(noise=1.0, response="linear"), surface=surface)
        for surface in (None, Twist(5.0, 5.0))
    ]
    (tmp_path / "frames").mkdir()
    truth = []
    for index, each in enumerate(scenes):
        rendered = render(each, size=SIZE)
        cv2.imwrite(str(tmp_path / "frames" / f"frame{index}.png"), rendered.image)
        truth.append(rendered.truth.marker_xy_px)

    def rms_px(*options: object) -> tuple[float, float]:
        table = tracked(made, str(tmp_path / "frames"), tmp_path / "a.npz", "--rest", "0", *options)
        rest_error, error = table["rest_xy_px"] - truth[0], table["xy_px"] - truth
        return float(np.sqrt((rest_error**2).mean())), float(np.sqrt((error**2).mean()))

    for told, usual in zip(rms_px("--response", "linear"), rms_px(), strict=True):
        assert told < 0.015 < 0.03 < usual
    command = ("track", made / "layout.json", tmp_path / "frames", "-o", tmp_path / "b.npz")
    assert "--response rec709: expected srgb" in refused(*command, "--response", "rec709")


def test_all_tables_and_sources_say_the_same(made: Path, tmp_path: Path) -> None:
    import pyarrow.parquet as pyarrow

    table = tracked(made, "video.avi", tmp_path / "a.npz")
    folder = tracked(made, "frames", tmp_path / "b.npz", "--fps", "25")
    for name in ("xy_px", "status", "displacement_mm", "time_s", "frame"):
        np.testing.assert_allclose(folder[name], table[name], atol=1e-6)
    for name in ("c.csv", "d.parquet"):
        assert run("track", made / "layout.json", made / "video.avi", "-o", tmp_path / name).exit_code == 0
    rows, parquet = rows_of(tmp_path / "c.csv"), pyarrow.read_table(tmp_path / "d.parquet")
    assert list(rows[0]) == parquet.column_names and len(rows) == parquet.num_rows == FRAMES * MARKERS
    assert parquet.schema.metadata[b"digest"].decode() == reference().digest
    for name, column, digits in (
        ("x_px", table["xy_px"][..., 0], 5),
        ("dy_mm", table["displacement_mm"][..., 1], 6),
    ):
        values = np.array([float(row[name]) for row in rows]).reshape(FRAMES, MARKERS)
        np.testing.assert_allclose(values, column, atol=10.0**-digits)
        np.testing.assert_allclose(parquet[name].to_numpy().reshape(FRAMES, MARKERS), column)
    assert {row["frame_status"] for row in rows} == {"tracked"}
    assert [row["marker"] for row in rows[:MARKERS]] == [str(i) for i in range(MARKERS)]


def test_the_summary_counts(made: Path, tmp_path: Path) -> None:
    result = run("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.csv")
    summary = json.loads((tmp_path / "a.csv.summary.json").read_text(encoding="utf-8"))
    assert summary["frames"] == {
        "declared": 24,
        "read": 24,
        "tracked": 24,
        "lost": 0,
        "unreadable": 0,
        "other_size": 0,
    }
    assert summary["marker_shares"] == {"measured": 1.0, "repaired": 0.0, "lost": 0.0}
    assert summary["starts"] == {"cold": 1, "warm": 23}
    assert summary["time_ms"]["p50"] <= summary["time_ms"]["p95"] <= summary["time_ms"]["p99"]
    truth = np.load(made / "truth.npy")
    length = np.linalg.norm(truth - truth[0], axis=2)
    largest = summary["largest_displacement"]
    assert largest["px"] == pytest.approx(length.max(), abs=0.5)
    assert length[largest["frame"], largest["marker"]] > length.max() - 0.5
    assert "read 24, tracked 24" in result.stdout and "p99" in result.stdout


def test_jitter_at_rest_is_the_noise_of_resting_markers(made: Path, tmp_path: Path) -> None:
    (tmp_path / "rest").mkdir()
    found = []
    for index in range(15):
        cv2.imwrite(str(tmp_path / "rest" / f"{index}.png"), shot(seed=index).image)
    table = tracked(made, str(tmp_path / "rest"), tmp_path / "a.npz")
    found = table["xy_px"].std(axis=0, ddof=1)
    summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
    assert summary["jitter_px"] == pytest.approx(np.sqrt(np.mean(found**2)), rel=0.1)


def test_overlay_and_quiver_plot(made: Path, tmp_path: Path) -> None:
    pictures = ("--overlay", tmp_path / "o.mp4", "--quiver", tmp_path / "q.png")
    tracked(made, "video.avi", tmp_path / "a.npz", *pictures)
    video = cv2.VideoCapture(str(tmp_path / "o.mp4"))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    assert len(frames) == FRAMES and video.get(cv2.CAP_PROP_FPS) == 25
    yellow = (np.abs(frames[-1].astype(int) - (80, 255, 255)).max(axis=2) < 60).sum()
    assert yellow > 20 * MARKERS
    quiver = cv2.imread(str(tmp_path / "q.png"))
    assert quiver is not None
    colored = (quiver.max(axis=2).astype(int) - quiver.min(axis=2) > 60).sum()
    assert colored > 50 * MARKERS and (quiver == 255).all(axis=2).mean() > 0.5
    assert not list(tmp_path.glob("*.part*"))


def test_rest_may_be_a_frame_or_an_image(made: Path, tmp_path: Path) -> None:
    truth = np.load(made / "truth.npy")
    by_number = tracked(made, "video.avi", tmp_path / "a.npz", "--rest", "7")
    by_image = tracked(made, "video.avi", tmp_path / "b.npz", "--rest", made / "frames" / "frame7.png")
    assert np.abs(by_number["displacement_px"] - (truth - truth[7])).max() < 1
    np.testing.assert_array_equal(by_number["displacement_px"], by_image["displacement_px"])
    scaled = tracked(made, "video.avi", tmp_path / "c.npz", "--mm-per-px", "0.1")
    np.testing.assert_allclose(scaled["displacement_mm"], scaled["displacement_px"] * (0.1, -0.1))


def test_cold_and_warm_give_the_same_ids(made: Path, tmp_path: Path) -> None:
    warm = tracked(made, "video.avi", tmp_path / "a.npz")
    cold = tracked(made, "video.avi", tmp_path / "b.npz", "--cold")
    assert (cold["start"] == "cold").all()
    np.testing.assert_array_equal(warm["status"], cold["status"])
    assert np.abs(warm["xy_px"] - cold["xy_px"]).max() < 0.3


LIMITED = """
import resource, sys
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
from cmpdesign.cli import main
main()
"""


def process(
    *arguments: object, code: str = "from cmpdesign.cli import main; main()"
) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_csv_that_no_longer_fits_is_cut_at_a_frame(made: Path, tmp_path: Path) -> None:
    arguments = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.csv")
    limited = process(60_000, *arguments, code=LIMITED)
    _, errors = limited.communicate(timeout=120)
    assert limited.returncode == 2 and "cannot be written" in errors and "frames are kept in" in errors
    rows = rows_of(tmp_path / "a.csv")
    assert len(rows) % MARKERS == 0 and 2 <= len(rows) // MARKERS < FRAMES
    assert f"{len(rows) // MARKERS} frames are kept" in errors
    assert all(row["dy_mm"] for row in rows)


def test_arrays_that_do_not_fit_are_kept_in_pieces_and_recovered(made: Path, tmp_path: Path) -> None:
    arguments = ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.npz")
    limited = process(100_000, *arguments, code=LIMITED)
    _, errors = limited.communicate(timeout=120)
    assert limited.returncode == 2 and "24 frames are kept in" in errors and "--recover" in errors
    assert not (tmp_path / "a.npz").exists()
    assert "--recover" in refused(*arguments)
    result = run(*arguments, "--recover")
    assert result.exit_code == 0 and "24 frames recovered" in result.stdout
    whole = tracked(made, "video.avi", tmp_path / "b.npz")
    table = loaded(tmp_path / "a.npz")
    np.testing.assert_allclose(table["xy_px"], whole["xy_px"])
    np.testing.assert_allclose(table["rest_xy_px"], whole["rest_xy_px"])
    assert "no table to recover" in refused(*arguments, "--recover")


@pytest.fixture(scope="module")
def long_folder(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Enough frames for a run to be caught in the middle."""
    folder = tmp_path_factory.mktemp("long")
    for index in range(4000):
        os.link(made / "frames" / f"frame{index % FRAMES}.png", folder / f"{index}.png")
    return folder


def caught(made: Path, source: Path, output: Path, number: int) -> tuple[int, str]:
    """A run that gets a signal while it is writing."""
    running = process("track", made / "layout.json", source, "-o", output)
    part = output.with_name(output.name + ".part")
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and running.poll() is None:
        if part.is_file() and part.stat().st_size > 100_000:
            break
        if part.is_dir() and list(part.glob("0*.npz")):
            break
        time.sleep(0.02)
    running.send_signal(number)
    _, errors = running.communicate(timeout=60)
    return running.returncode, errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_completes_the_file(number: int, made: Path, long_folder: Path, tmp_path: Path) -> None:
    code, errors = caught(made, long_folder, tmp_path / "a.csv", number)
    assert code == 130 and "Traceback" not in errors
    rows = rows_of(tmp_path / "a.csv")
    assert len(rows) % MARKERS == 0 and 5 < len(rows) // MARKERS < 4000
    assert json.loads((tmp_path / "a.csv.summary.json").read_text())["frames"]["read"] == len(rows) // MARKERS


@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_a_killed_run_is_recovered(ending: str, made: Path, long_folder: Path, tmp_path: Path) -> None:
    output = tmp_path / f"a.{ending}"
    code, _ = caught(made, long_folder, output, signal.SIGKILL)
    assert code == -signal.SIGKILL and not output.exists()
    result = run("track", made / "layout.json", long_folder, "-o", output, "--recover")
    assert result.exit_code == 0 and "frames recovered" in result.stdout
    table = loaded(output) if ending == "npz" else {}
    frames = len(table["frame"]) if table else len(rows_of(output)) / MARKERS
    assert frames > 5 and not output.with_name(output.name + ".part").exists()


def test_a_bar_stays_on_stderr(made: Path, tmp_path: Path) -> None:
    arguments = [
        str(v) for v in ("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.npz")
    ]
    result = CliRunner().invoke(app, arguments, env={"FORCE_COLOR": "1"})
    assert result.exit_code == 0 and "tracking" in result.stderr and "read 24" in result.stdout


def test_nothing_tracked_is_exit_code_1(made: Path, tmp_path: Path) -> None:
    (tmp_path / "dark").mkdir()
    cv2.imwrite(str(tmp_path / "dark" / "0.png"), np.zeros((100, 100, 3), np.uint8))
    quiver = tmp_path / "q.png"
    result = run(
        "track", made / "layout.json", tmp_path / "dark", "-o", tmp_path / "a.npz", "--quiver", quiver
    )
    assert result.exit_code == 1 and "is not drawn" in result.stderr and not quiver.exists()
    assert loaded(tmp_path / "a.npz")["frame_status"].tolist() == [2]


@pytest.mark.parametrize(
    ("source", "options", "expected"),
    [
        ("missing.avi", (), "no such file or folder"),
        ("layout.json", (), "is no video: it is a layout file"),
        ("empty", (), "holds no image"),
        ("video.avi", ("-o", "a.txt"), "unknown ending; expected one of .npz, .parquet, .csv"),
        ("video.avi", ("--rest", "99"), "has fewer frames"),
        ("video.avi", ("--rest", "missing.png"), "missing.png"),
        ("video.avi", ("--rest", "dark.png"), "no pattern is found in dark.png"),
        ("video.avi", ("--fps", "0"), "--fps is 0"),
        ("video.avi", ("--mm-per-px", "nan"), "--mm-per-px is nan"),
        ("video.avi", ("--overlay", "o.gif"), "unknown ending; expected one of .mp4, .avi, .mkv"),
        ("video.avi", ("--quiver", "q.pdf"), "expected .png"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    source: str,
    options: tuple[str, ...],
    expected: str,
    made: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    cv2.imwrite("dark.png", np.zeros((50, 50, 3), np.uint8))
    before = sorted(tmp_path.rglob("*"))
    path = tmp_path / "empty" if source == "empty" else made / source
    line = refused("track", made / "layout.json", path, "-o", "work/a.npz", *options)
    assert expected in line
    assert sorted(tmp_path.rglob("*")) == before


def test_a_photo_in_a_phones_own_format_says_what_to_do(made: Path, tmp_path: Path) -> None:
    photo = tmp_path / "IMG_0001.HEIC"
    photo.write_bytes(b"\0\0\0\x18ftypheic")
    line = refused("track", made / "layout.json", photo, "-o", tmp_path / "a.npz")
    assert "photos of this format are not read; expected JPEG" in line and "Most Compatible" in line


def test_parquet_without_pyarrow_says_how_to_get_it(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    line = refused("track", made / "layout.json", made / "video.avi", "-o", tmp_path / "a.parquet")
    assert "of the extra [parquet]" in line and list(tmp_path.iterdir()) == []


def test_tables_of_one_name_have_their_own_summaries(made: Path, tmp_path: Path) -> None:
    written = []
    for frames, kind in enumerate(("npz", "csv", "parquet"), start=1):
        table, options = tmp_path / f"a.{kind}", ("--frames", frames, "--quiver", tmp_path / "q.png")
        result = run("track", made / "layout.json", made / "video.avi", "-o", table, *options)
        written.append(result.stdout)
        assert f"wrote {table}\nwrote {table}.summary.json\nwrote {tmp_path / 'q.png'}\n" in result.stdout
    for frames, kind in enumerate(("npz", "csv", "parquet"), start=1):
        summary = json.loads((tmp_path / f"a.{kind}.summary.json").read_text())
        assert summary["frames"]["read"] == frames
        assert summary["frames_per_s"] > 0 and "frames per s " in written[0]


def test_arrows_of_noise_are_not_shown_as_motion(made: Path, tmp_path: Path) -> None:
    """Arrows of a resting pattern stay near the circle that shows the noise; those of a motion do not."""
    (tmp_path / "rest").mkdir()
    for index in range(4):
        cv2.imwrite(str(tmp_path / "rest" / f"{index}.png"), shot(seed=index).image)

    def colored(source: str) -> int:
        tracked(made, source, tmp_path / "a.npz", "--quiver", tmp_path / "q.png")
        picture = np.asarray(cv2.imread(str(tmp_path / "q.png")), dtype=int)[:-80]
        (tmp_path / "a.npz").unlink()
        return int((picture.max(axis=2) - picture.min(axis=2) > 60).sum())

    resting, moved = colored(str(tmp_path / "rest")), colored("video.avi")
    assert 0 < resting < 0.6 * moved


def test_the_summary_shows_quality_and_what_to_do(made: Path, tmp_path: Path) -> None:
    """Frames whose red and blue are swapped are the other side: none is tracked until the command is told."""
    (tmp_path / "rgb").mkdir()
    for index in range(2):
        image = cv2.imread(str(made / "frames" / f"frame{index}.png"))
        assert image is not None
        cv2.imwrite(str(tmp_path / "rgb" / f"frame{index}.png"), image[:, :, ::-1])
    command = ("track", made / "layout.json", tmp_path / "rgb", "-o", tmp_path / "a.npz")
    result = run(*command)
    assert result.exit_code == 1 and "red and blue are swapped" in " ".join(result.stdout.split())
    summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
    assert summary["reasons"] == {"swapped_channels": 2} and summary["quality"] is None
    assert run(*command, "--channels", "rgb").exit_code == 0
    summary = json.loads((tmp_path / "a.npz.summary.json").read_text(encoding="utf-8"))
    assert summary["frames"]["tracked"] == 2 and summary["quality"]["hints"] == []
    assert summary["quality"]["edge_px"] > 8 and summary["quality"]["contrast"] > 20
    assert run(*command, "--side", "back").exit_code == 0  # so seen, but with the ids of the mirror image
