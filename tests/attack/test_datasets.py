"""Data sets: plans of strangers, and folders in which files were changed, replaced, or edited."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from cmpdesign import CmpDesignError
from cmpdesign.data import check, load
from cmpdesign.data.folder import finished_records, open_folder, plan_digest, read_plan, write_manifest
from cmpdesign.data.frames.plan import prepare_plan
from cmpdesign.data.shard import make_shard
from cmpdesign.files.images import to_png
from extractor import ExtractorError
from tests.attack.documents import wrong_documents
from tests.support.command import refused, run
from tests.support.layouts import small_text
from tests.support.made.datasets import contents, make_serially, write_plan

PNG = to_png(np.full((40, 40, 3), 90, np.uint8))
BLOBS = "blobs = {repeat = {whole = [0, 2]}, of = {centre_mm = [{uniform = [-3, 3]}, 0], radius_mm = 0.2}}"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of 4 frames in 2 shards."""
    folder = tmp_path_factory.mktemp("whole")
    return make_serially(write_plan(folder), folder / "made")


@pytest.fixture
def made(whole: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(whole, tmp_path / "made"))


def edited_plan(folder: Path, old: str, new: str) -> Path:
    path = write_plan(folder)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def with_background(folder: Path, background: str) -> Path:
    return write_plan(folder, more=f"\n[scene.background]\n{background}\n")


# -- plans


SECRETS = (
    'chance = 0.0\nof = {kind = "picture", path = "PATH"}',
    'choice = [{kind = "plain"}, {kind = "picture", path = "PATH"}]\nweights = [1, 0]',
    'kind = "picture"\npath = {choice = ["a.png", "PATH"], weights = [1, 0]}',
    'kind = "plain"\nunused = {repeat = 0, of = {kind = "picture", path = "PATH"}}',
    'choice = [{kind = "plain"}, {kind = "picture", path = "PATH"}]\nweights = [1e9, 1]',
    'kind = "plain"\npath = "PATH"',
)


@pytest.mark.parametrize("background", SECRETS)
@pytest.mark.parametrize("secret", ["key", "../key", "../outside.png", "link.png"])
def test_no_private_file_gets_into_a_data_set(tmp_path: Path, background: str, secret: str) -> None:
    folder = tmp_path / "plan"
    folder.mkdir()
    for path, content in ((folder / "key", b"private"), (tmp_path / "key", b"private")):
        path.write_bytes(content)
    (folder / "a.png").write_bytes(PNG)
    (tmp_path / "outside.png").write_bytes(PNG)
    (folder / "link.png").symlink_to(tmp_path / "outside.png")
    line = refused(
        "dataset", with_background(folder, background.replace("PATH", secret)), "-o", tmp_path / "out"
    )
    assert "path" in line
    assert not (tmp_path / "out").exists()


def test_a_picture_of_another_folder_is_taken_where_the_caller_allows_it(tmp_path: Path) -> None:
    folder, shared = tmp_path / "plan", tmp_path / "shared"
    folder.mkdir()
    shared.mkdir()
    (shared / "a.png").write_bytes(PNG)
    (folder / "b.png").write_bytes(PNG[:-1] + b"\x83")
    plan = with_background(folder, 'kind = "picture"\npath = {choice = ["../shared/a.png", "b.png"]}')
    assert "allow its folder by --inputs-from" in refused("dataset", plan, "-o", tmp_path / "out")
    prepared = prepare_plan(plan, [shared])
    taken = [name for name in prepared.files if name.startswith("inputs/")]
    assert len(taken) == 2 and all(name in json.dumps(prepared.document["scene"]) for name in taken)
    assert "shared" not in json.dumps(prepared.document)


@pytest.mark.parametrize(
    "blobs",
    [
        "{repeat = 1000, of = {repeat = 1000, of = {repeat = 1000, of = 1}}}",
        "{repeat = {choice = [1, 1000]}, of = {repeat = {whole = [0, 1000]}, of = {repeat = 1000, of = [1, 2]}}}",
        "{chance = 0.1, of = {choice = [1, {repeat = 1000, of = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}]}}",
    ],
)
def test_repeats_in_repeats_are_counted_before_drawing(tmp_path: Path, blobs: str) -> None:
    started = time.monotonic()
    line = refused("dataset", edited_plan(tmp_path, BLOBS, f"blobs = {blobs}"), "-o", tmp_path / "out")
    assert "the limit is 10000" in line and time.monotonic() - started < 5


@pytest.mark.parametrize("scene", ["repeat = 3\nof = {seed = 1}", "uniform = [0, 1]", "choice = [1, 2]"])
def test_a_scene_that_is_no_table_is_one_line(tmp_path: Path, scene: str) -> None:
    plan = write_plan(tmp_path)
    head = plan.read_text(encoding="utf-8").partition("[scene]")[0]
    plan.write_text(f"{head}[scene]\n{scene}\n", encoding="utf-8")
    assert "scene" in refused("dataset", plan, "-o", tmp_path / "out")


def test_an_infinite_number_is_one_line(tmp_path: Path) -> None:
    plan = edited_plan(tmp_path, "friction = 0", "friction = inf")
    assert "scene: holds the number inf" in refused("dataset", plan, "-o", tmp_path / "out")


def test_of_two_plans_at_the_same_time_one_is_made(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    plans = [prepare_plan(write_plan(tmp_path / "a")), prepare_plan(write_plan(tmp_path / "b", kind="jpeg"))]
    for attempt in range(8):
        folder, barrier = tmp_path / f"out{attempt}", Barrier(2)

        def start(number: int, folder: Path = folder, barrier: Barrier = barrier) -> bool:
            barrier.wait()
            try:
                open_folder(folder, plans[number])
            except CmpDesignError as error:
                assert "another plan" in str(error)
                return False
            return True

        with ThreadPoolExecutor(2) as pool:
            won = list(pool.map(start, range(2)))
        assert sorted(won) == [False, True]
        assert read_plan(folder)["digest"] == plans[won.index(True)].document["digest"]


# -- files of a data set that were changed


def test_a_replaced_layout_is_refused_by_name(made: Path, tmp_path: Path) -> None:
    (made / "layouts" / "small.json").write_text(small_text("round", 3), encoding="utf-8")
    (made / "tables" / "000001.parquet").unlink()
    plan = write_plan(tmp_path)
    before = contents(made)
    assert "layouts/small.json was changed" in refused("dataset", plan, "-o", made, "--workers", 1)
    assert contents(made) == before
    with pytest.raises(CmpDesignError, match=r"small\.json was changed"):
        make_shard(str(made), 1)
    with pytest.raises(CmpDesignError, match=r"small\.json was changed"):
        load(made).layouts  # noqa: B018
    assert any("small.json was changed" in problem for problem in check(made).problems)


def test_a_replaced_picture_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(PNG)
    plan = with_background(tmp_path, 'kind = "picture"\npath = "a.png"')
    prepared = prepare_plan(plan)
    open_folder(tmp_path / "out", prepared)
    (name,) = prepared.document["inputs"]
    (tmp_path / "out" / name).write_bytes(PNG[:-1] + b"\x83")
    assert f"{name} was changed" in refused("dataset", plan, "-o", tmp_path / "out", "--workers", 1)


@pytest.mark.parametrize("name", ["images/000001.tar", "tables/000000.parquet"])
def test_changed_content_of_equal_size_is_found_by_a_check(made: Path, name: str) -> None:
    assert check(made).problems == () and run("dataset", made, "--check").exit_code == 0
    data = bytearray((made / name).read_bytes())
    data[len(data) // 2] ^= 1
    (made / name).write_bytes(data)
    checked = check(made)
    assert len(checked.problems) == 1 and checked.problems[0].startswith(f"{name}: the content was changed")
    assert (checked.shards, checked.of_shards, checked.frames) == (1, 2, 2)
    result = run("dataset", made, "--check", "--json")
    assert result.exit_code == 1 and json.loads(result.stdout)["problems"] == list(checked.problems)


def test_the_remedy_of_a_check_mends_the_shard(made: Path, whole: Path) -> None:
    (made / "images" / "000001.tar").write_bytes(bytes((made / "images" / "000001.tar").stat().st_size))
    remedy = check(made).problems[0].partition("delete ")[2].partition(",")[0]
    (made / remedy).unlink()
    make_shard(str(made), 1)
    assert contents(made) == contents(whole)


def test_a_manifest_of_other_digests_is_found(made: Path) -> None:
    told = json.loads((made / "manifest.json").read_text(encoding="utf-8"))
    told["shards"][0]["files"]["images/000000.tar"]["sha256"] = "0" * 64
    (made / "manifest.json").write_text(json.dumps(told), encoding="utf-8")
    assert [problem.partition(":")[0] for problem in check(made).problems] == ["manifest.json"]


# -- documents that were edited


def _use(folder: Path) -> None:
    """All that reads the documents of a finished data set."""
    frames = load(folder)
    assert len(frames) == sum(1 for _ in frames)
    write_manifest(folder)
    check(folder)


def _is_survived(folder: Path) -> bool:
    try:
        _use(folder)
    except (CmpDesignError, ExtractorError) as error:
        assert "\n" not in str(error)
        return False
    return True


# Every Nth damaged form in make test, all of them in make test-all.
FORMS = pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.slow)])


@FORMS
def test_edited_records_make_the_shard_anew(made: Path, every: int) -> None:
    """A record that contradicts the plan or its files counts as no record."""
    (made / "manifest.json").unlink()
    path = made / "shards" / "000001.json"
    for text in list(wrong_documents(json.loads(path.read_text(encoding="utf-8"))))[::every]:
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        assert sum(record.frames for record in finished_records(made)) in (2, 4)
    _is_survived(made)


@pytest.mark.parametrize(
    "edit",
    [
        lambda told: told.update(frames=99),
        lambda told: told.update(shard=0),
        lambda told: told.update(digest="0" * 64),
        lambda told: told["files"].pop("images/000001.tar"),
        lambda told: told["files"].update({"../../secret": {"bytes": 1, "sha256": "0" * 64}}),
        lambda told: told["files"]["images/000001.tar"].update(bytes=1),
    ],
)
def test_a_lie_in_a_record_is_no_record(made: Path, whole: Path, edit: Callable[[Any], Any]) -> None:
    path = made / "shards" / "000001.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    edit(told)
    path.write_text(json.dumps(told), encoding="utf-8")
    assert write_manifest(made).frames == 2
    assert len(load(made)) == 2 and not load(made).complete
    make_shard(str(made), 1)
    write_manifest(made)
    assert contents(made) == contents(whole)


@FORMS
def test_edited_manifests_are_left_aside(made: Path, every: int) -> None:
    path = made / "manifest.json"
    for text in list(wrong_documents(json.loads(path.read_text(encoding="utf-8"))))[::every]:
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        assert [record.frames for record in finished_records(made)] == [2, 2]
    assert _is_survived(made)


@FORMS
def test_edited_plans_are_one_line(made: Path, every: int) -> None:
    path = made / "plan.json"
    refusals = 0
    texts = list(wrong_documents(json.loads(path.read_text(encoding="utf-8"))))[::every]
    for text in texts:
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        try:
            read_plan(made)
        except CmpDesignError as error:
            refusals += 1
            assert "\n" not in str(error)
    assert refusals > 0.98 * len(texts)


def _signed(told: dict[str, Any]) -> str:
    """The text with the digest that its values have."""
    try:
        return json.dumps(told | {"digest": plan_digest(told)})
    except (ValueError, TypeError, KeyError, AttributeError):
        return json.dumps(told)


@pytest.mark.parametrize(
    "edit",
    [
        {"frames": 10**9, "frames_a_shard": 1},
        {"frames": 0},
        {"frames_a_shard": 0},
        {"designs": []},
        {"designs": [{"name": "small", "layout": "../../plan.json", "digest": "0" * 64}]},
        {"designs": [{"name": "small", "layout": "/etc/passwd", "digest": "0" * 64}]},
        {"inputs": {"../secret": "0" * 64}},
        {"image": {"kind": "gif", "quality": 95}},
        {"scene": []},
        {"weights": ["a"]},
        {"format": "cmp-extraction-plan"},
    ],
)
def test_a_signed_plan_of_wrong_values_is_one_line(made: Path, edit: dict[str, Any]) -> None:
    path = made / "plan.json"
    path.write_text(_signed(json.loads(path.read_text(encoding="utf-8")) | edit), encoding="utf-8")
    started = time.monotonic()
    _is_survived(made)
    assert time.monotonic() - started < 5


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@example(name="inputs", value={"\n": None})
@given(
    name=st.sampled_from(["frames", "seed", "designs", "inputs", "image", "markers", "scene"]),
    value=JSON_VALUES,
)
def test_any_signed_plan_is_survived(whole: Path, tmp_path: Path, name: str, value: Any) -> None:
    folder = tmp_path / "any"
    if not folder.exists():
        folder.mkdir()
        for path in whole.iterdir():
            if path.name != "plan.json" and path.is_dir():
                (folder / path.name).symlink_to(path)
    told = json.loads((whole / "plan.json").read_text(encoding="utf-8"))
    (folder / "plan.json").write_text(_signed(told | {name: value}), encoding="utf-8", errors="surrogatepass")
    _is_survived(folder)
