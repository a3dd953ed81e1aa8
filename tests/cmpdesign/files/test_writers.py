"""Every writer: after a kill in the middle the earlier file is complete, and names of unfinished files cannot be
predicted.
"""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from cmpdesign.errors import OutputError
from cmpdesign.files.atomic import Stage, staged_file, write_file, write_folder
from cmpdesign.files.video_writer import VideoWriter
from cmpdesign.scene.files.frame_writer import PngFolderWriter
from tests.support.command import run
from tests.support.layouts import small_text

ROOT = Path(__file__).parents[3]
STAGES = re.compile(r"\.cmpdesign-[a-z0-9_]{8}")

# -- the rule: files are written in one place

# What may open files for writing, beside modules that stage them.
MAY_WRITE = {
    "cmpdesign/files/atomic.py": "the place itself",
    "cmpdesign/evaluation/journal.py": "grows, under a lock",
    "cmpdesign/tracking/sinks/csv_sink.py": "grows, under a lock, opened exclusively",
    "cmpdesign/tracking/sinks/unfinished.py": "names the tables that grow",
    "cmpdesign/tracking/sinks/assembly.py": "is given a staged path",
    "extractor/contact/gel.py": "into a stream, which the command writes at once",
    "cmpdesign/tracking/export/video.py": "is given a staged path",
    "cmpdesign/tracking/recording/images.py": "beside the chunks of a run, which grow under a lock",
    "cmpdesign/products/mold/step/step.py": "a temporary folder for the kernel's own reader",
    "cmpdesign/products/mesh/three_mf.py": "an archive in memory",
    "cmpdesign/reading/problem_report.py": "an archive in memory",
    "cmpdesign/data/files/webdataset.py": "is given a staged path",
    "cmpdesign/cli/terminal.py": "to nowhere",
    "cmpdesign/studio/builds.py": "an archive in memory, and the output of a process in a private folder",
}
WRITING_CALLS = {
    "write_text",
    "write_bytes",
    "imwrite",
    "VideoWriter",
    "savez",
    "savez_compressed",
    "ZipFile",
}
STAGED = {"Stage", "staged_file"}


def unstaged_writes(root: Path, packages: tuple[str, ...]) -> list[str]:
    found = []
    for path in sorted(path for package in packages for path in (root / package).rglob("*.py")):
        name = str(path.relative_to(root))
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        names |= {
            alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names
        }
        if name in MAY_WRITE or names & STAGED:
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and (is_writing(node)):
                found.append(f"{name}:{node.lineno}")
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found += (
                    [f"{name}:{node.lineno}: {node.value}"] if node.value in (".part", ".tmp", ".new") else []
                )
    return found


def is_writing(call: ast.Call) -> bool:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name == "open":
        modes = [value.value for value in call.args if isinstance(value, ast.Constant)]
        return any(isinstance(mode, str) and set(mode) & set("wxa+") and len(mode) < 4 for mode in modes)
    return name in WRITING_CALLS and isinstance(call.func, ast.Attribute)


def test_files_are_written_in_one_place() -> None:
    assert unstaged_writes(ROOT, ("cmpdesign", "extractor")) == []


def test_the_rule_finds_what_breaks_it(tmp_path: Path) -> None:
    (tmp_path / "cmpdesign").mkdir()
    for line in (
        "path.write_text('x')",
        "path.open('wb')",
        "np.savez(path)",
        "x = path.with_name('a' + '.part')",
    ):
        (tmp_path / "cmpdesign" / "a.py").write_text(line)
        assert unstaged_writes(tmp_path, ("cmpdesign",)), line


# -- commands that are killed

KILLED = """
import os, signal
replace = os.replace
def kill(source, target, **options):
    if os.path.realpath(target).startswith(os.getcwd()):
        os.kill(os.getpid(), signal.SIGKILL)
    replace(source, target, **options)
os.replace = kill
from cmpdesign.cli import main
main()
"""
WRITERS = {
    "build": ("build", "honeycomb", "--set", "layers=3", "-o", "."),
    "image and truth": ("render", "layout.json", "-o", "a.png", "--truth", "t.npz", "--noise", "3"),
    "verify": ("verify", "layout.json", "seen.png", "-o", ".", "--debug", "stages"),
    "track": (
        *("track", "layout.json", "frames", "-o", "a.npz"),
        *("--overlay", "o.mp4", "--quiver", "q.png", "--fps", "10"),
    ),
    "track as text": ("track", "layout.json", "frames", "-o", "a.csv"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("writers")
    (folder / "layout.json").write_text(small_text("honeycomb", 2), encoding="utf-8")
    options = ("--size", "200x160", "--pitch", "24")
    assert run("render", folder / "layout.json", "-o", folder / "seen.png", *options).exit_code == 0
    (folder / "frames").mkdir()
    for index in range(2):
        os.link(folder / "seen.png", folder / "frames" / f"{index}.png")
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not STAGES.match(path.relative_to(folder).parts[0])
    }


def copied(made: Path, folder: Path) -> None:
    for name, data in contents(made).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_killed_command_leaves_earlier_files_whole(kind: str, made: Path, tmp_path: Path) -> None:
    """Killed at the first rename; the next run of the command leaves nothing of the killed one."""
    copied(made, tmp_path)
    outputs = [
        word for before, word in zip(WRITERS[kind], WRITERS[kind][1:], strict=False) if before in OPTIONS
    ]
    for name in (*outputs, "pattern.svg", "seen.overlay.png", "verify.json"):
        if name != "." and "." in name:
            (tmp_path / name).write_bytes(b"earlier " + name.encode())
    before = contents(tmp_path)
    command = [sys.executable, "-c", KILLED, *WRITERS[kind]]
    killed = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert all(".part" in name for name in after.keys() - before.keys())
    assert [path for path in tmp_path.rglob("*") if STAGES.fullmatch(path.name)] or kind == "track as text"
    again = subprocess.run(
        [sys.executable, "-c", "from cmpdesign.cli import main; main()", *with_recovery(kind)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert again.returncode == 0, again.stderr
    assert not [path for path in tmp_path.rglob("*") if STAGES.fullmatch(path.name) or ".part" in path.name]


OPTIONS = ("-o", "--truth", "--overlay", "--quiver", "--debug")


def with_recovery(kind: str) -> tuple[str, ...]:
    return (*WRITERS[kind], *(["--recover"] if kind == "track as text" else []))


# -- links at names that could be guessed


@pytest.mark.parametrize("kind", WRITERS)
def test_no_link_beside_a_file_is_followed(kind: str, made: Path, tmp_path: Path) -> None:
    copied(made, tmp_path)
    outputs = [
        word for before, word in zip(WRITERS[kind], WRITERS[kind][1:], strict=False) if before in OPTIONS
    ]
    (tmp_path / "mine").write_bytes(b"mine")
    for name in (*outputs, "pattern.svg", "layout.json", "verify.json"):
        if "." in name.strip("."):
            stem, suffix = name.rsplit(".", 1)
            for guess in (f"{name}.tmp", f"{name}.new", f"{stem}.part.{suffix}", f".{name}", f"{name}~"):
                (tmp_path / guess).symlink_to(tmp_path / "mine")
            if not kind.startswith("track"):
                (tmp_path / f"{name}.part").symlink_to(tmp_path / "mine")
    words = [
        str(tmp_path / word) if word in outputs or (tmp_path / word).exists() else word
        for word in WRITERS[kind]
    ]
    result = run(*words)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "mine").read_bytes() == b"mine"


# -- stages


def test_a_stage_of_a_living_process_stays(tmp_path: Path) -> None:
    with Stage(tmp_path) as stage:
        write_file(tmp_path / "a", "1")
        assert stage.folder.is_dir() and stage.folder.stat().st_mode & 0o077 == 0
        write_folder(tmp_path, {"b": "2"})
        assert stage.folder.is_dir()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_stages_made_at_the_same_time_stay_though_their_empty_folder_is_removed(tmp_path: Path) -> None:
    def work(_: int) -> None:
        for _ in range(50):
            with Stage(tmp_path / "inner" / "folder") as stage:
                (stage.folder / "a").write_text("1")
            for folder in ("inner/folder", "inner"):
                with suppress(OSError):
                    (tmp_path / folder).rmdir()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
    assert not list(tmp_path.iterdir())


def test_stages_of_dead_processes_go_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / ".cmpdesign-0a_b3c9d").mkdir()
    (tmp_path / ".cmpdesign-0a_b3c9d" / "part").write_text("unfinished")
    kept = {".cmpdesign-mine", ".cmpdesign-UPPERCAS", ".cmpdesign-01234567", ".cmpdesign-abcdefgh"}
    for name in (".cmpdesign-mine", ".cmpdesign-UPPERCAS"):
        (tmp_path / name).mkdir()
    (tmp_path / ".cmpdesign-01234567").write_text("a file")
    (tmp_path / ".cmpdesign-abcdefgh").symlink_to(tmp_path / ".cmpdesign-mine")
    write_file(tmp_path / "a", "1")
    assert {path.name for path in tmp_path.iterdir()} == kept | {"a"}


@pytest.mark.parametrize("error", [OSError(28, "No space left"), KeyboardInterrupt(), ValueError()])
def test_an_error_while_writing_leaves_nothing(error: BaseException, tmp_path: Path) -> None:
    (tmp_path / "a").write_text("earlier")
    with pytest.raises(type(error)), staged_file(tmp_path / "a") as staged:
        staged.write_text("half")
        raise error
    assert [path.name for path in tmp_path.iterdir()] == ["a"] and (tmp_path / "a").read_text() == "earlier"


def test_files_and_their_folder_are_flushed_before_and_after_the_rename(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    fsync, replace = os.fsync, os.replace

    def watched(descriptor: int) -> None:
        calls.append("folder" if os.path.isdir(f"/proc/self/fd/{descriptor}") else "file")  # noqa: PTH112
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    monkeypatch.setattr(os, "replace", lambda *a, **k: calls.append("rename") or replace(*a, **k))
    write_file(tmp_path / "a", "1")
    assert calls == ["file", "rename", "folder"]
    calls.clear()
    write_folder(tmp_path, {"b": "1", "c": "2"})
    assert calls == ["file", "file", "rename", "rename", "folder"]


PICTURE = np.full((32, 32, 3), 90, np.uint8)


def test_a_folder_of_frames_is_there_when_it_is_complete(tmp_path: Path) -> None:
    writer = PngFolderWriter(tmp_path / "frames")
    writer.add(PICTURE)
    assert not (tmp_path / "frames").exists()
    writer.close()
    assert [path.name for path in tmp_path.rglob("*")] == ["frames", "frame_000000.png"]
    assert (tmp_path / "frames").stat().st_mode & 0o700 == 0o700


def test_a_video_that_is_not_whole_is_kept_beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.avi").write_bytes(b"earlier")
    writer = VideoWriter(tmp_path / "a.avi", 10)
    for _ in range(3):
        writer.add(PICTURE)
    monkeypatch.setattr("cmpdesign.files.video_writer.count_frames", lambda path: 2)
    with pytest.raises(OutputError, match=r"2 of 3 frames could be written.*kept in .*a\.incomplete\.avi"):
        writer.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.avi", "a.incomplete.avi"]
    assert (tmp_path / "a.avi").read_bytes() == b"earlier"
    assert cv2.VideoCapture(str(tmp_path / "a.incomplete.avi")).get(cv2.CAP_PROP_FRAME_COUNT) == 3
