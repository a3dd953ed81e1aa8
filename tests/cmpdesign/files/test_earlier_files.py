"""A build removes the files of earlier builds that are not made again, and no other file."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cmpdesign.cli import app
from cmpdesign.files.earlier_files import LIST_NAME, files_with_lists, find_stale_files, remove_files
from cmpdesign.products.registry import PRODUCTS


def build(output: Path, files: dict[str, str | bytes]) -> list[str]:
    """Build as the command does; the names of the removed files."""
    listed = files_with_lists(files, ["mold/", "mesh/"])
    stale = find_stale_files(output, listed)
    for name, content in listed.items():
        path = output / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return [str(path.relative_to(output)) for path in remove_files(stale)]


FIRST: dict[str, str | bytes] = {
    "a.svg": "1", "mold/base.step": b"2", "mold/white.step": "3", "mesh/pictures/x.png": b"4", "mesh/b.stl": b"5"
}  # fmt: skip


def test_only_what_is_no_longer_made_goes(tmp_path: Path) -> None:
    assert build(tmp_path, FIRST) == []
    (tmp_path / "mold" / "notes.txt").write_text("mine")
    assert build(tmp_path, {"mold/base.step": b"6"}) == ["mold/white.step"]
    # Products that are not made again stay, and so does what nobody here wrote.
    assert (tmp_path / "mesh" / "b.stl").read_bytes() == b"5" and (tmp_path / "a.svg").exists()
    assert (tmp_path / "mold" / "notes.txt").read_text() == "mine"
    assert build(tmp_path, {"mesh/b.stl": b"5"}) == ["mesh/pictures/x.png"]
    assert not (tmp_path / "mesh" / "pictures").exists()
    assert build(tmp_path, {"mesh/b.stl": b"5"}) == []


def test_changed_files_stay(tmp_path: Path) -> None:
    build(tmp_path, FIRST)
    (tmp_path / "mold" / "white.step").write_text("mine now")
    (tmp_path / "mesh" / "pictures" / "mine.png").write_text("also mine")
    assert build(tmp_path, {"mold/base.step": b"2", "mesh/b.stl": b"5"}) == ["mesh/pictures/x.png"]
    assert (tmp_path / "mold" / "white.step").read_text() == "mine now"
    assert [path.name for path in (tmp_path / "mesh" / "pictures").iterdir()] == ["mine.png"]


@pytest.mark.parametrize(
    "name", ["../a.svg", "../../elsewhere.txt", "sub/../../a.svg", "link/a.svg", "folder"]
)
def test_nothing_outside_the_folder_is_touched(name: str, tmp_path: Path) -> None:
    """Files outside of the folder are not removed even if the list names them."""
    output = tmp_path / "out"
    build(output, FIRST)
    (tmp_path / "elsewhere.txt").write_text("1")
    (output / "mold" / "link").symlink_to(output)
    (output / "mold" / "folder").mkdir()
    listed = output / "mold" / LIST_NAME
    document = json.loads(listed.read_text())
    document["sha256"][name] = document["sha256"]["../a.svg"] = with_digest("1")
    listed.write_text(json.dumps(document))
    assert build(output, {"mold/base.step": b"2"}) == ["mold/white.step"]
    assert (output / "a.svg").exists() and (tmp_path / "elsewhere.txt").exists()
    assert (output / "mold" / "folder").is_dir()


def with_digest(content: str) -> str:
    document = json.loads(files_with_lists({"x/y": content}, ["x/"])["x/" + LIST_NAME])
    return str(document["sha256"]["y"])


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"format": "cmp-files", "version": 2, "sha256": {}}', "\x00"]
)
def test_a_list_that_cannot_be_understood_removes_nothing(text: str, tmp_path: Path) -> None:
    build(tmp_path, FIRST)
    (tmp_path / "mold" / LIST_NAME).write_text(text)
    assert build(tmp_path, {"mold/base.step": b"2"}) == []
    assert (tmp_path / "mold" / "white.step").exists()


def test_the_command_says_what_it_removed(tmp_path: Path) -> None:
    def run(*more: str) -> str:
        result = CliRunner().invoke(app, ["build", "honeycomb", "-o", str(tmp_path / "out"), *more])
        assert result.exit_code == 0, result.output
        return result.output

    laser = tmp_path / "out" / "laser"
    run("--set", "layers=2", "--only", "laser,svg", "--set", "laser.outline=true")
    before = {path.name for path in laser.iterdir()}
    (laser / "mine.svg").write_text("mine")
    text = run("--set", "layers=2", "--only", "laser")
    gone = before - {path.name for path in laser.iterdir()}
    # An old job that would still cut the pad out.
    assert gone == {f"5-outline.{kind}" for kind in ("svg", "dxf", "lbrn2", "gcode")}
    assert all(f"{name}: written by an earlier build" in text for name in gone) and LIST_NAME not in text
    assert (laser / "mine.svg").exists() and (tmp_path / "out" / "pattern.svg").exists()


@pytest.mark.parametrize(
    "name", ["a\0b", "x" * 300, "d/" * 3000, "\ud800", "loop", "loop/a", "pipe", ".", ""]
)
def test_odd_names_in_a_list_are_no_files_to_remove(name: str, tmp_path: Path) -> None:
    build(tmp_path, FIRST)
    (tmp_path / "mold" / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "mold" / "pipe")
    path = tmp_path / "mold" / LIST_NAME
    document = json.loads(path.read_text(encoding="utf-8"))
    document["sha256"][name] = "0" * 64
    path.write_text(json.dumps(document), encoding="utf-8")
    before = sorted(tmp_path.rglob("*"))
    assert [one for one in build(tmp_path, {"mold/base.step": b"6"}) if one != "mold/white.step"] == []
    assert {one for one in before if one not in sorted(tmp_path.rglob("*"))} <= {
        tmp_path / "mold" / "white.step"
    }


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def built(output: Path, *arguments: str) -> dict[str, bytes]:
    """The files of a folder after a build, without the lists."""
    result = CliRunner().invoke(app, ["build", "honeycomb", "-o", str(output), *arguments])
    assert result.exit_code == 0, result.output
    return {name: data for name, data in contents(output).items() if not name.endswith(LIST_NAME)}


# Solids take seconds, and the rule is the same for every folder.
@pytest.mark.parametrize("only", sorted(PRODUCTS.keys() - {"mold", "mesh"}))
def test_a_folder_holds_the_files_of_one_pattern(only: str, tmp_path: Path) -> None:
    """After a build of one product from another pattern, no file of the earlier pattern remains."""
    first = ("--set", "layers=2", "--only", "svg,layout,preview,report,laser,print")
    other = ("--set", "layers=3", "--only", only)
    built(tmp_path / "mixed", *first)
    (tmp_path / "mixed" / "mine.txt").write_text("mine")
    after = built(tmp_path / "mixed", *other)
    assert after == {**built(tmp_path / "clean", *other), "mine.txt": b"mine"}
    # The same pattern again: what earlier builds made stays.
    more = built(tmp_path / "mixed", *other[:2], "--only", "layout")
    assert after.items() <= more.items() and "layout.json" in more
    gone = built(tmp_path / "mixed", *first[:2], "--only", "layout")
    assert set(gone) == {"layout.json", "mine.txt"}


def test_a_changed_file_of_another_pattern_stays(tmp_path: Path) -> None:
    built(tmp_path, "--set", "layers=2")
    (tmp_path / "pattern.svg").write_text("drawn over")
    after = built(tmp_path, "--set", "layers=3", "--only", "layout")
    assert set(after) == {"pattern.svg", "layout.json"} and after["pattern.svg"] == b"drawn over"
