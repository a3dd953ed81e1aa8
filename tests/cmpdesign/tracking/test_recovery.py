"""Tables after killed runs and damage on disk: every complete frame is kept, and lost frames are named."""

from __future__ import annotations

import csv
import io
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cmpdesign.tracking.sinks.tables import open_sink
from cmpdesign.tracking.table import TrackTable
from extractor import Tracker
from tests.support.command import refused, run
from tests.support.layouts import small_text
from tests.support.tracking.scenes import LAYERS, reference

MARKERS = 91
FRAMES = 23
CHUNK = 5
KINDS = ("csv", "npz", "parquet")
# Reasons as file names make them: with line breaks, quotes, commas and formulas; and the cells of a CSV table.
REASONS = ("", 'a "b",\n7,8', "line\nbreak", "cr\rlf\r\n", "=1+1")
CELLS = ("no image", r'a "b",\n7,8', r"line\nbreak", r"cr\rlf\r\n", "'=1+1")

# A run of frames without an image, as quick as can be, that is killed before it closes its table.
KILLED = """
import os, signal, sys
from pathlib import Path
from cmpdesign.tracking.sinks import chunk_sink
from cmpdesign.tracking.sinks.tables import open_sink
from cmpdesign.tracking.table import TrackTable
from extractor import Tracker, load_layout
chunk_sink.CHUNK_FRAMES = int(sys.argv[3])
reasons = eval(sys.argv[4])
for name in sys.argv[5:]:
    tracker = Tracker(load_layout(sys.argv[1]))
    sink = open_sink(Path(name), TrackTable(tracker))
    for index in range(int(sys.argv[2])):
        sink.add(tracker.track(None, time_s=index / 10, reason=reasons[index % len(reasons)] or "no image"))
os.kill(os.getpid(), signal.SIGKILL)
"""


def killed(layout: Path, frames: int, *outputs: Path) -> None:
    arguments = [str(layout), str(frames), str(CHUNK), repr(REASONS), *map(str, outputs)]
    done = subprocess.run([sys.executable, "-c", KILLED, *arguments], capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a layout, and the remains of a killed run's table of every kind."""
    folder = tmp_path_factory.mktemp("killed")
    (folder / "layout.json").write_text(small_text("honeycomb", LAYERS), encoding="utf-8")
    killed(folder / "layout.json", FRAMES, *(folder / f"a.{kind}" for kind in KINDS))
    return folder


def left(made: Path, folder: Path, kind: str) -> Path:
    """The table of a killed run in a separate folder, with the pieces beside the table."""
    source, target = made / f"a.{kind}.part", folder / f"a.{kind}.part"
    (shutil.copytree if source.is_dir() else shutil.copy)(source, target)
    return folder / f"a.{kind}"


def frames_of(path: Path) -> list[int]:
    """The frame numbers of a table, read by other readers; every frame has all its markers."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as file:
            assert all(len(file[name]) == len(file["frame"]) for name in ("xy_px", "status", "reason"))
            return [int(number) for number in file["frame"]]
    if path.suffix == ".parquet":
        import pyarrow.parquet

        table = pyarrow.parquet.read_table(path)
        frames, markers = table["frame"].to_pylist(), table["marker"].to_pylist()
    else:
        rows = list(csv.DictReader(io.StringIO(path.read_bytes().decode(), newline="")))
        frames, markers = [int(row["frame"]) for row in rows], [int(row["marker"]) for row in rows]
        assert all(row["reason"] == CELLS[int(row["frame"]) % len(CELLS)] for row in rows)
    assert markers == list(range(MARKERS)) * (len(markers) // MARKERS)
    return frames[::MARKERS]


def recover(made: Path, table: Path) -> tuple[list[int], str]:
    """The frames after a recovery, and its warnings."""
    result = run("track", made / "layout.json", "frames", "-o", table, "--recover")
    assert result.exit_code == 0, result.output
    frames = frames_of(table)
    assert f"{len(frames)} frames recovered" in result.stdout
    assert [path.name for path in table.parent.iterdir()] == [table.name]
    return frames, result.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_written_is_recovered(kind: str, made: Path, tmp_path: Path) -> None:
    frames, warnings = recover(made, left(made, tmp_path, kind))
    assert frames == list(range(FRAMES if kind == "csv" else FRAMES // CHUNK * CHUNK)) and not warnings


@pytest.mark.parametrize("kind", ["npz", "parquet"])
@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "noise", "gone", "another"])
@pytest.mark.parametrize("number", range(FRAMES // CHUNK))
def test_a_damaged_chunk_costs_its_own_frames(
    kind: str, damage: str, number: int, made: Path, tmp_path: Path
) -> None:
    table = left(made, tmp_path, kind)
    chunk = tmp_path / f"a.{kind}.part" / f"{number:06d}.npz"
    data = chunk.read_bytes()
    middle = len(data) // 2
    changed = {
        "cut": data[:middle],
        "empty": b"",
        "flipped": data[:middle] + bytes([data[middle] ^ 0x10]) + data[middle + 1 :],
        "noise": np.random.default_rng(number).bytes(len(data)),
        "another": npz_of(frame=np.arange(3)),
    }
    if damage == "gone":
        chunk.unlink()
    else:
        chunk.write_bytes(changed[damage])
    frames, warnings = recover(made, table)
    lost = range(number * CHUNK, (number + 1) * CHUNK)
    assert frames == [i for i in range(FRAMES // CHUNK * CHUNK) if i not in lost]
    if damage != "gone":
        assert f"{number:06d}.npz is damaged (" in warnings
    is_last = number == FRAMES // CHUNK - 1
    if not is_last:
        assert f"frames {lost[0]} to {lost[-1]} are lost" in warnings
    elif damage != "gone":
        assert f"frames from {lost[0]} on are lost" in warnings


def npz_of(**columns: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **columns)
    return file.getvalue()


@pytest.mark.parametrize("kind", ["npz", "parquet"])
def test_other_files_beside_the_chunks_do_not_matter(kind: str, made: Path, tmp_path: Path) -> None:
    table = left(made, tmp_path, kind)
    for name in ("about.npz", "000009.new", "whole.npz"):
        (tmp_path / f"a.{kind}.part" / name).write_bytes(b"")
    assert recover(made, table)[0] == list(range(FRAMES // CHUNK * CHUNK))


@pytest.mark.parametrize("kind", ["npz", "parquet"])
def test_chunks_are_kept_when_all_are_damaged(kind: str, made: Path, tmp_path: Path) -> None:
    table = left(made, tmp_path, kind)
    chunks = sorted((tmp_path / f"a.{kind}.part").iterdir())
    for chunk in chunks:
        chunk.write_bytes(b"")
    line = refused("track", made / "layout.json", "frames", "-o", table, "--recover")
    assert (
        f"{chunks[0].name} is damaged" in line and f"and {len(chunks)} more" in line and "it is kept" in line
    )
    assert sorted((tmp_path / f"a.{kind}.part").iterdir()) == chunks and not table.exists()


@settings(max_examples=25, deadline=None)
@given(share=st.floats(0.06, 1))
def test_a_text_is_cut_at_a_whole_frame(
    share: float, made: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    table = left(made, folder, "csv")
    part = folder / "a.csv.part"
    data = part.read_bytes()[: round(share * part.stat().st_size)]
    part.write_bytes(data)
    head, *rows = csv.reader(io.StringIO(data.decode(), newline=""))
    complete = rows if data.endswith(b"\n") else rows[:-1]
    whole = sum(len(row) == len(head) for row in complete) // MARKERS
    assert recover(made, table) == (list(range(whole)), "")


@pytest.mark.parametrize("damage", ["rows", "zeros"])
def test_a_damaged_frame_of_a_text_is_named(damage: str, made: Path, tmp_path: Path) -> None:
    table = left(made, tmp_path, "csv")
    part = tmp_path / "a.csv.part"
    data = part.read_bytes()
    start = data.index(b"\n4,0.4") + 1
    rows = data[start:].splitlines(keepends=True)
    hurt = b"".join(rows[5:]) if damage == "rows" else b"\0" * len(rows[0]) + b"".join(rows[1:])
    part.write_bytes(data[:start] + hurt)
    frames, warnings = recover(made, table)
    assert frames == [i for i in range(FRAMES) if i != 4]
    assert "frame 4 is damaged (86 of 91 rows)" in warnings or "damaged" in warnings


def test_another_layout_loses_nothing(made: Path, tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text(small_text("honeycomb", 3), encoding="utf-8")
    killed(made / "layout.json", 1, tmp_path / "a.csv")
    before = (tmp_path / "a.csv.part").read_bytes()
    line = refused("track", tmp_path / "other.json", "frames", "-o", tmp_path / "a.csv", "--recover")
    assert "frame 0 is damaged (91 of 37 rows)" in line and (tmp_path / "a.csv.part").read_bytes() == before
    assert recover_alone(made, tmp_path) == [0]


def recover_alone(made: Path, folder: Path) -> list[int]:
    (folder / "other.json").unlink()
    return recover(made, folder / "a.csv")[0]


def test_a_run_killed_before_its_first_frame(made: Path, tmp_path: Path) -> None:
    """The recovery prints a message and removes the remains; another run needs no recovery."""
    tables = [tmp_path / f"{name}.{kind}" for kind in KINDS for name in "ab"]
    killed(made / "layout.json", 0, *tables)
    for recovered, table in zip(tables[::2], tables[1::2], strict=True):
        result = run("track", made / "layout.json", "frames", "-o", recovered, "--recover")
        assert result.exit_code == 1 and "the run ended before its first frame" in result.stderr
        tracker = Tracker(reference())
        sink = open_sink(table, TrackTable(tracker))
        sink.add(tracker.track(None))
        sink.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.csv", "b.npz", "b.parquet"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_that_is_being_written_is_left_alone(kind: str, made: Path, tmp_path: Path) -> None:
    table = tmp_path / f"a.{kind}"
    tracker = Tracker(reference())
    sink = open_sink(table, TrackTable(tracker))
    command = ("track", made / "layout.json", made / "layout.json", "-o", table)
    assert "in use by another run" in refused(*command, "--recover")
    sink.add(tracker.track(None))
    sink.close()
    assert frames_count(table) == 1
    assert "no table to recover" in refused(*command, "--recover")
    assert "is a folder; give a file's name" in refused(*command[:3], "-o", tmp_path.root, "--recover")


def frames_count(path: Path) -> int:
    if path.suffix == ".csv":
        return (len(path.read_text(encoding="utf-8").splitlines()) - 1) // MARKERS
    return len(frames_of(path))


@pytest.mark.parametrize("kind", KINDS)
def test_a_link_in_the_place_of_the_pieces_is_refused(kind: str, made: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "000000.npz").write_text("mine")
    (tmp_path / f"a.{kind}.part").symlink_to(tmp_path / "mine")
    line = refused("track", made / "layout.json", "frames", "-o", tmp_path / f"a.{kind}", "--recover")
    assert "of an interrupted run; delete it" in line
    assert (tmp_path / "mine" / "000000.npz").read_text() == "mine"
