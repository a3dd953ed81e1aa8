"""``cmpdesign export zarr``: a replay buffer that Zarr itself opens, with the numbers of the runs."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import zarr

from tests.support.command import refused, run
from tests.support.tracking.files import FRAMES, MARKERS, loaded, write_moving_pattern
from tests.support.tracking.press import write_press

SHORT = 5


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_moving_pattern(tmp_path_factory.mktemp("made"))
    for name, options in (("a.npz", ()), ("b.npz", ("--frames", SHORT))):
        command = ("track", folder / "layout.json", folder / "video.avi", "-o", folder / name)
        assert run(*command, *options).exit_code == 0
    return folder


def test_episodes_lie_one_after_another(made: Path, tmp_path: Path) -> None:
    images = ("--images", made / "video.avi", "--images", made / "frames")
    result = run("export", "zarr", made / "a.npz", made / "b.npz", "-o", tmp_path / "buffer.zarr", *images)
    assert result.exit_code == 0, result.output
    assert f"episodes 2 frames {FRAMES + SHORT}" in " ".join(result.stdout.split())
    buffer = zarr.open_group(str(tmp_path / "buffer.zarr"), mode="r")
    assert buffer.metadata.zarr_format == 2  # what Diffusion Policy's Zarr reads
    ends = buffer["meta/episode_ends"]
    assert ends[:].tolist() == [FRAMES, FRAMES + SHORT] and ends.dtype == np.int64
    runs = [loaded(made / name) for name in ("a.npz", "b.npz")]
    assert {buffer[f"data/{key}"].shape[0] for key in buffer["data"]} == {FRAMES + SHORT}
    for key, name in (("displacement_mm", "displacement_mm"), ("status", "status"), ("time_s", "time_s")):
        values = np.concatenate([one[name] for one in runs])
        stored = buffer[f"data/tactile_{key}"]
        np.testing.assert_array_equal(stored[:], values.astype(stored.dtype))
    assert buffer["data/tactile_position_mm"].shape == (FRAMES + SHORT, MARKERS, 2)
    for place, source in ((3, 3), (FRAMES + 1, 1)):
        picture = cv2.imread(str(made / "frames" / f"frame{source}.png"))
        assert picture is not None
        np.testing.assert_array_equal(buffer["data/tactile_image"][place], picture[:, :, ::-1])
    assert buffer.attrs["digest"] == str(runs[0]["digest"])


def test_reconstructed_runs_have_three_coordinates(tmp_path: Path) -> None:
    press = write_press(tmp_path)
    command = ("reconstruct", press / "layout.json", press / "rig.toml", "0", press / "frames")
    assert run(*command, "-o", tmp_path / "s.npz").exit_code == 0
    assert run("export", "zarr", tmp_path / "s.npz", "-o", tmp_path / "b.zarr").exit_code == 0
    buffer, table = zarr.open_group(str(tmp_path / "b.zarr"), mode="r"), loaded(tmp_path / "s.npz")
    count = len(table["layer"])
    for key, name in (("displacement_mm", "3D_Displacements"), ("position_mm", "3D_Positions")):
        np.testing.assert_array_equal(buffer[f"data/tactile_{key}"][:], table[name][:, :count])


def test_bad_input_is_one_line_and_no_folder(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "expected .zarr" in refused("export", "zarr", made / "a.npz", "-o", tmp_path / "buffer")
    (tmp_path / "b.zarr").mkdir()
    assert "exists; delete it" in refused("export", "zarr", made / "a.npz", "-o", tmp_path / "b.zarr")
    monkeypatch.setitem(sys.modules, "zarr", None)
    line = refused("export", "zarr", made / "a.npz", "-o", tmp_path / "c.zarr")
    assert "of the extra [export]" in line
    assert [path.name for path in tmp_path.iterdir()] == ["b.zarr"]
