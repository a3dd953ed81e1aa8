"""``cmpdesign export lerobot``: the files of a LeRobotDataset v3.0, read with pyarrow, PyAV and LeRobot itself."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pyarrow.parquet as parquet
import pytest

from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, MARKERS, loaded, write_moving_pattern
from tests.support.tracking.press import FRAMES as PRESS_FRAMES
from tests.support.tracking.press import write_press

VIDEO_KEY = "observation.images.tactile"
VIDEO = f"videos/{VIDEO_KEY}/chunk-000/file-000.mp4"
SHORT = 7  # frames of the second episode
# An interpreter that has lerobot; without it, the test makes an environment.
PYTHON_VARIABLE = "CMPDESIGN_LEROBOT_PYTHON"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A moving pattern, its run, and a shorter run."""
    folder = write_moving_pattern(tmp_path_factory.mktemp("made"))
    for name, options in (("a.npz", ()), ("b.npz", ("--frames", SHORT))):
        command = ("track", folder / "layout.json", folder / "video.avi", "-o", folder / name)
        assert run(*command, *options).exit_code == 0
    return folder


@pytest.fixture(scope="module")
def dataset(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes with images: one from the video, one from the folder."""
    path = tmp_path_factory.mktemp("out") / "dataset"
    images = ("--images", made / "video.avi", "--images", made / "frames")
    command = ("export", "lerobot", made / "a.npz", made / "b.npz", "-o", path, "--task", "press", *images)
    result = run(*command)
    assert result.exit_code == 0, result.output
    assert f"episodes 2 frames {FRAMES + SHORT} fps 25" in " ".join(result.stdout.split())
    return path


def test_the_files_are_those_of_the_layout(dataset: Path) -> None:
    files = sorted(str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file())
    assert files == [
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
        VIDEO,
    ]
    info = json.loads((dataset / "meta/info.json").read_text(encoding="utf-8"))
    assert info["codebase_version"] == "v3.0" and info["fps"] == 25 and info["splits"] == {"train": "0:2"}
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, FRAMES + SHORT, 1)
    features = info["features"]
    assert features["observation.tactile.displacement_mm"]["shape"] == [MARKERS, 2]
    assert features["observation.tactile.status"] == {"dtype": "uint8", "shape": [MARKERS], "names": None}
    assert features[VIDEO_KEY]["shape"] == [240, 320, 3] and features["timestamp"]["dtype"] == "float32"
    tasks = parquet.read_table(dataset / "meta/tasks.parquet").to_pylist()
    assert tasks == [{"task_index": 0, "__index_level_0__": "press"}]


def test_frames_are_those_of_the_runs(made: Path, dataset: Path) -> None:
    runs = [loaded(made / name) for name in ("a.npz", "b.npz")]
    table = parquet.read_table(dataset / "data/chunk-000/file-000.parquet")
    assert table.num_rows == FRAMES + SHORT
    displacement = np.array(table["observation.tactile.displacement_mm"].to_pylist(), np.float32)
    truth = np.concatenate([one["displacement_mm"] for one in runs]).astype(np.float32)
    np.testing.assert_array_equal(displacement, truth)
    position = np.array(table["observation.tactile.position_mm"].to_pylist(), np.float32)
    assert np.abs(position[0] - runs[0]["layout_xy_mm"]).max() < 0.02
    np.testing.assert_array_equal(
        np.array(table["observation.tactile.status"].to_pylist()), np.concatenate([r["status"] for r in runs])
    )
    assert table["frame_index"].to_pylist() == [*range(FRAMES), *range(SHORT)]
    assert table["index"].to_pylist() == [*range(FRAMES + SHORT)]
    assert table["episode_index"].to_pylist() == [0] * FRAMES + [1] * SHORT
    np.testing.assert_allclose(table["timestamp"].to_numpy()[:FRAMES], np.arange(FRAMES) / 25, atol=1e-6)
    rows = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(r["dataset_from_index"], r["dataset_to_index"], r["length"]) for r in rows] == [
        (0, FRAMES, FRAMES),
        (FRAMES, FRAMES + SHORT, SHORT),
    ]
    assert [r[f"videos/{VIDEO_KEY}/from_timestamp"] for r in rows] == [0, FRAMES / 25]
    assert rows[1][f"videos/{VIDEO_KEY}/to_timestamp"] == (FRAMES + SHORT) / 25


def test_statistics_are_those_of_numpy(made: Path, dataset: Path) -> None:
    stats = json.loads((dataset / "meta/stats.json").read_text(encoding="utf-8"))
    values = np.concatenate([loaded(made / name)["displacement_mm"] for name in ("a.npz", "b.npz")])
    rows = values.astype(np.float32).reshape(-1, 2).astype(float)
    of = stats["observation.tactile.displacement_mm"]
    for name, figure in (
        ("min", rows.min(0)),
        ("max", rows.max(0)),
        ("mean", rows.mean(0)),
        ("std", rows.std(0)),
    ):
        np.testing.assert_allclose(of[name], figure, rtol=1e-6, atol=1e-9)
    assert of["count"] == [FRAMES + SHORT] and of["q01"][0] <= of["q50"][0] <= of["q99"][0]
    assert np.shape(stats["observation.tactile.status"]["mean"]) == (MARKERS,)
    pictures = [cv2.imread(str(made / "frames" / f"frame{k}.png")) for k in [*range(FRAMES), *range(SHORT)]]
    pixels = np.stack([one[::4, ::4, ::-1] for one in pictures if one is not None]) / 255
    image = stats[VIDEO_KEY]
    assert np.shape(image["mean"]) == (3, 1, 1)
    np.testing.assert_allclose(np.ravel(image["mean"]), pixels.mean(axis=(0, 1, 2)), rtol=1e-9)
    np.testing.assert_allclose(np.ravel(image["std"]), pixels.std(axis=(0, 1, 2)), rtol=1e-6)
    np.testing.assert_allclose(np.ravel(image["max"]), pixels.max(axis=(0, 1, 2)))


def test_the_video_has_the_frames_at_their_times(made: Path, dataset: Path) -> None:
    with av.open(str(dataset / VIDEO)) as container:
        frames = list(container.decode(video=0))
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(FRAMES + SHORT) / 25, atol=1e-5)
    for place, source in ((0, 0), (FRAMES - 1, FRAMES - 1), (FRAMES + 3, 3)):
        picture = cv2.imread(str(made / "frames" / f"frame{source}.png"))
        assert picture is not None
        error = frames[place].to_ndarray(format="bgr24").astype(float) - picture
        assert np.sqrt(np.mean(error**2)) < 4


def test_lost_markers_are_nan_and_statistics_know_it(made: Path, tmp_path: Path) -> None:
    columns = loaded(made / "b.npz")
    for name in ("xy_px", "displacement_px", "displacement_mm"):
        columns[name][2] = np.nan
        columns[name][:, 5] = np.nan
    columns["status"][2] = columns["status"][:, 5] = 0
    np.savez(tmp_path / "c.npz", **columns)  # type: ignore[arg-type]
    assert run("export", "lerobot", tmp_path / "c.npz", "-o", tmp_path / "d").exit_code == 0
    table = parquet.read_table(tmp_path / "d/data/chunk-000/file-000.parquet")
    got = np.array(table["observation.tactile.displacement_mm"].to_pylist(), np.float32)
    np.testing.assert_array_equal(got, columns["displacement_mm"].astype(np.float32))
    text = (tmp_path / "d/meta/stats.json").read_text(encoding="utf-8")
    assert "NaN" not in text
    mean = json.loads(text)["observation.tactile.displacement_mm"]["mean"]
    np.testing.assert_allclose(mean, np.nanmean(columns["displacement_mm"], axis=(0, 1)), rtol=1e-4)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("layout.json",), "layout.json: unknown ending; expected .npz"),
        (("truth.npz",), "truth.npz is no run"),
        (("missing.npz",), "cannot be read"),
        (("a.npz", "--images", "video.avi", "--images", "video.avi"), "--images is given 2 times for 1 runs"),
        (("a.npz", "--images", "short"), f"has 1 of the {FRAMES} frames"),
        (("a.npz", "--fps", "-1"), "--fps is -1"),
        (("a.npz", "other.npz"), "the digest is"),
    ],
)
def test_bad_input_is_one_line_and_no_folder(
    words: tuple[str, ...], expected: str, made: Path, tmp_path: Path
) -> None:
    np.savez(tmp_path / "truth.npz", xy=np.zeros(3))
    np.savez(tmp_path / "other.npz", **(loaded(made / "a.npz") | {"digest": np.array("0")}))  # type: ignore[arg-type]
    (tmp_path / "short").mkdir()
    (tmp_path / "short" / "0.png").write_bytes((made / "frames" / "frame0.png").read_bytes())
    before = sorted(tmp_path.rglob("*"))
    files = [tmp_path / word if (tmp_path / word).exists() else made / word for word in words if "." in word]
    given = [next((f for f in files if f.name == word), word) for word in words]
    given = [tmp_path / "short" if word == "short" else word for word in given]
    assert expected in refused("export", "lerobot", *given, "-o", tmp_path / "out")
    assert sorted(tmp_path.rglob("*")) == before


def test_an_existing_folder_is_kept(made: Path, tmp_path: Path) -> None:
    assert "exists; delete it" in refused("export", "lerobot", made / "a.npz", "-o", tmp_path)


def test_without_av_one_line_says_how_to_get_it(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    command = ("export", "lerobot", made / "a.npz", "-o", tmp_path / "d")
    assert "of the extra [export]" in refused(*command, "--images", made / "video.avi")
    assert run(*command).exit_code == 0


LOAD = """
import json, sys
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

found = {}
for name in sys.argv[1:]:
    data = LeRobotDataset("local/test", root=name, video_backend="pyav")
    items = [data[k] for k in range(len(data))]
    key = "observation.images.tactile"
    found[name] = {
        "frames": len(data),
        "episodes": data.num_episodes,
        "tasks": sorted({item["task"] for item in items}),
        "displacement": [np.asarray(item["observation.tactile.displacement_mm"]).tolist() for item in items],
        "status": [np.asarray(item["observation.tactile.status"]).tolist() for item in items],
        "images": [np.asarray(item[key])[:, ::16, ::16].tolist() for item in items] if key in items[0] else None,
    }
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def lerobot_python(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """An interpreter with lerobot, in a separate environment of some GB; skips where it cannot be installed."""
    if given := os.environ.get(PYTHON_VARIABLE):
        yield given
        return
    folder = tmp_path_factory.mktemp("lerobot")
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    commands = (
        [sys.executable, "-m", "venv", str(folder)],
        [str(python), "-m", "pip", "install", "--quiet", "lerobot"],
    )
    for command in commands:
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=False)
            problem = (done.stderr.strip().splitlines() or ["no message"])[-1] if done.returncode else ""
        except (OSError, subprocess.TimeoutExpired) as error:
            problem = str(error)
        if problem:
            shutil.rmtree(folder)
            pytest.skip(
                f"lerobot cannot be installed ({problem}); set {PYTHON_VARIABLE} to a Python that has it"
            )
    yield str(python)
    shutil.rmtree(folder)


@pytest.mark.slow
def test_lerobot_loads_the_data_sets(made: Path, dataset: Path, lerobot_python: str, tmp_path: Path) -> None:
    """Every number of both runs comes back from LeRobot's own loader, and the images at their frames."""
    press = write_press(tmp_path)
    command = ("reconstruct", press / "layout.json", press / "rig.toml", "0", press / "frames")
    assert run(*command, "-o", tmp_path / "s.npz").exit_code == 0
    assert run("export", "lerobot", tmp_path / "s.npz", "-o", tmp_path / "space").exit_code == 0
    environment = os.environ | {"HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path / "cache")}
    names = [str(dataset), str(tmp_path / "space")]
    done = subprocess.run(
        [lerobot_python, "-c", LOAD, *names],
        capture_output=True,
        text=True,
        env=environment,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    flat, space = (found[name] for name in names)
    assert (flat["frames"], flat["episodes"], flat["tasks"]) == (FRAMES + SHORT, 2, ["press"])
    runs = [loaded(made / name) for name in ("a.npz", "b.npz")]
    truth = np.concatenate([one["displacement_mm"] for one in runs]).astype(np.float32)
    np.testing.assert_array_equal(np.array(flat["displacement"], np.float32), truth)
    np.testing.assert_array_equal(flat["status"], np.concatenate([one["status"] for one in runs]))
    for place, source in ((0, 0), (FRAMES - 1, FRAMES - 1), (FRAMES, 0), (FRAMES + 3, 3)):
        picture = cv2.imread(str(made / "frames" / f"frame{source}.png"))
        assert picture is not None
        pixels = picture[::16, ::16, ::-1].transpose(2, 0, 1) / 255
        assert np.sqrt(np.mean((np.array(flat["images"][place]) - pixels) ** 2)) < 0.02
    table = loaded(tmp_path / "s.npz")
    assert space["frames"] == PRESS_FRAMES and space["images"] is None
    moved = table["3D_Displacements"][:, : len(table["layer"])]
    np.testing.assert_array_equal(np.array(space["displacement"], np.float32), moved)
