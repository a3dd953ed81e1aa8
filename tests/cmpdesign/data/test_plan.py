"""Plans that cannot be carried out are refused in one line, before any work, and leave no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmpdesign.data.folder import open_folder, read_plan
from cmpdesign.data.frames.plan import prepare_plan
from tests.support.command import refused
from tests.support.made.datasets import DESIGN, write_plan

SQUARE = 'pattern = "square"\nlayers = 3\npitch_mm = 2.0\n'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("frames = 4", "frames = 5", "frames is 5; it must be a multiple of frames_a_shard, 2, as in 6"),
        ("frames = 4", "frame = 4", "frame is unknown (did you mean frames?)"),
        ('["small.toml"]', '["small.toml", "small.toml"]', "designs has two designs of the name small"),
        ('["small.toml"]', '["smal.toml"]', "smal.toml: no such file"),
        ('["small.toml"]', '["square.toml"]', "the design square has no triangles"),
        ('["small.toml"]', '["small.toml"]\nweights = [1, 2]', "designs: weights is [1.0, 2.0]"),
        ('kind = "png"', 'kind = "gif"', "image.kind = 'gif' must be"),
        ("noise = {", "nose = {", "[sensor] nose is unknown (did you mean noise?)"),
        ("noise = {whole = [1, 2]}", "noise = {uniform = [0, 256]}", "it must lie between 0 and 255"),
        ("noise = {whole = [1, 2]}", "noise = {uniform = [2, 1]}", "scene.sensor.noise: uniform is [2, 1]"),
        ("size_px", "seed = 3\nsize_px", "scene.seed is not allowed in a plan"),
        ('kind = "cube"', 'kind = "cub"', "contact.indenter.kind is 'cub' (did you mean cube?)"),
    ],
)
def test_a_wrong_plan_is_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    plan = write_plan(tmp_path)
    (tmp_path / "square.toml").write_text(SQUARE, encoding="utf-8")
    text = plan.read_text(encoding="utf-8")
    assert old in text
    plan.write_text(text.replace(old, new, 1), encoding="utf-8")
    line = refused("dataset", plan, "-o", tmp_path / "out")
    assert said in line
    assert not (tmp_path / "out").exists()


def test_jpeg_in_the_sensor_and_of_the_file_is_one_too_many(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, kind="jpeg")
    plan.write_text(plan.read_text().replace("noise = {", "jpeg_quality = 90\nnoise = {"), encoding="utf-8")
    assert "scene.sensor.jpeg_quality is not allowed with" in refused("dataset", plan, "-o", tmp_path / "out")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--shards", "0"), "shards is 0; it must be a number above 0"),
        (("--shards", "3:2"), "A below B"),
        (("--shards", "3"), "the plan has 2 shards"),
        (("--scheduler", "slurm"), "it must be local or dask=ADDRESS"),
        (("--scheduler", "dask=a:1", "--workers", "2"), "workers is not allowed with a dask scheduler"),
        (("--scheduler", "dask=missing.json"), "missing.json: no such scheduler file"),
        (("--workers", "1000"), "it must be from 1 to 512"),
    ],
)
def test_wrong_options_are_one_line(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    assert said in refused("dataset", write_plan(tmp_path), "-o", tmp_path / "out", *words)
    assert not (tmp_path / "out" / "shards").exists()


def test_folders_of_other_things_are_left_alone(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    assert "is not empty and holds no plan.json" in refused("dataset", plan, "-o", tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.toml", "small.toml"]


def test_processes_may_start_at_the_same_time(tmp_path: Path) -> None:
    """As the jobs of an array do: another one has made a part of the folder, or all."""
    prepared = prepare_plan(write_plan(tmp_path))
    folder = tmp_path / "data"
    (folder / "layouts").mkdir(parents=True)
    (folder / ".cmpdesign-abcdefgh").mkdir()
    open_folder(folder, prepared)
    open_folder(folder, prepared)
    assert read_plan(folder)["digest"] == prepared.document["digest"]


def test_the_digest_is_of_what_frames_depend_on(tmp_path: Path) -> None:
    digest = prepare_plan(write_plan(tmp_path)).document["digest"]
    assert prepare_plan(write_plan(tmp_path, frames=40)).document["digest"] == digest
    assert prepare_plan(write_plan(tmp_path, frames_a_shard=4)).document["digest"] != digest
    plan = write_plan(tmp_path)
    (tmp_path / "small.toml").write_text(DESIGN.replace("2.0", "2.1"), encoding="utf-8")
    assert prepare_plan(plan).document["digest"] != digest


def test_the_shipped_plans_can_be_carried_out() -> None:
    from cmpdesign.design.templates import plan_templates

    assert plan_templates()
    for path in plan_templates().values():
        assert prepare_plan(path).shards >= 1
