"""Records are printed with the names, units and meanings of their own fields."""

from __future__ import annotations

import pytest
from pydantic import Field

from cmpdesign.cli.progress import working
from cmpdesign.cli.records import print_maps, print_parts, print_rows
from cmpdesign.documents.document import DocumentPart
from cmpdesign.watch import notice, warn, watched


class Press(DocumentPart):
    """A part of the test's record."""

    frame: int
    force_n: tuple[float, ...]
    note: str | None = None


class Record(DocumentPart):
    """The test's record."""

    depth_mm: float = Field(description="Of the press; 0 is none.")
    size_px: tuple[int, int] = (640, 480)
    marker_share: float = 0.25
    time_ms: dict[str, float] = Field({"p50": 2.5})
    press: Press = Press(frame=0, force_n=(0.0, -1.5))
    held: tuple[str, ...] = ()
    is_bent: bool = False
    values: dict[str, float] = Field({"fx_px": 1088.585, "k1": -0.04})
    deviations: dict[str, float] = Field({"fx_px": 0.198, "k1": 0.0005})


def rows_of(printed: str) -> list[list[str]]:
    return [[cell for cell in line.split("  ") if cell] for line in printed.splitlines()]


def test_rows_have_title_unit_and_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    print_rows(
        Record(depth_mm=1.23456), "depth_mm size_px marker_share time_ms press held is_bent", is_bent="flat"
    )
    assert [[cell.strip() for cell in row] for row in rows_of(capsys.readouterr().out)] == [
        ["depth", "1.235 mm (of the press; 0 is none)"],
        ["size", "640 x 480 px"],
        ["marker share", "25.00%"],
        ["time", "p50 2.5 ms"],
        ["press", "frame 0, force 0, -1.5 N"],
        ["is bent", "flat"],
    ]


def test_parts_and_maps_are_tables(capsys: pytest.CaptureFixture[str]) -> None:
    print_parts([Press(frame=3, force_n=(1.0,)), Press(frame=12, force_n=(2.0,), note="far")])
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["frame", "force", "N", "note"],
        ["3", "1"],
        ["12", "2", "far"],
    ]
    print_maps(Record(depth_mm=0.0), "values deviations")
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["values", "deviations"],
        ["fx_px", "1088.59", "0.198"],
        ["k1", "-0.04", "0.0005"],
    ]


def test_a_watcher_is_told_at_once() -> None:
    said: list[tuple[str, bool]] = []
    with watched(lambda *step: None, lambda *line: said.append(line)):
        notice("live at ws://127.0.0.1:8765")
        warn("no times")
    warn("nobody watches")
    assert said == [("live at ws://127.0.0.1:8765", False), ("no times", True)]


def test_lines_of_a_notice_stay_lines(capsys: pytest.CaptureFixture[str]) -> None:
    with working("verifying"):
        notice("a.png: verified\n  refocus\x1b[2J")
        warn("one\nline")
    printed = capsys.readouterr()
    assert printed.out == "a.png: verified\n  refocus\\u001b[2J\n"
    assert printed.err == "warning: one\\nline\n"
