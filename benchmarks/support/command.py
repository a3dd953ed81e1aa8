"""Shared by the commands of benchmarks: options and the width of tables."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.frame.conditions import machine_conditions
from benchmarks.frame.published import Page, json_text, publish
from cmpdesign.files.atomic import write_file


def publishing_parser(
    name: str, document: str | None, quick: str, publish: bool = True
) -> argparse.ArgumentParser:
    """The options of ``python -m benchmarks.NAME``.

    Args:
        name: of the benchmark.
        document: its docstring, whose first line is the description.
        quick: the items of which a quick run has few.
        publish: the documentation shows the figures.
    """
    description = (document or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=description)
    parser.add_argument("--quick", action="store_true", help=f"few {quick}: a look, no figures to quote")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results too")
    if publish:
        parser.add_argument(
            "--publish", action="store_true", help="write docs/measured and the pages that show it"
        )
    return parser


def wide_console(width: int) -> Console:
    """The terminal, or this number of columns without a terminal: a pipe has no width, and tables would be cut."""
    terminal = Console()
    return terminal if terminal.is_terminal else Console(width=width)


def write_json(path: Path, results: Mapping[str, Any]) -> None:
    """Write conditions and results to a file."""
    write_file(path, json_text({"conditions": machine_conditions(), **results}))


def write_published(name: str, results: Mapping[str, Any], blocks: Mapping[str, str]) -> list[Path]:
    """Write docs/measured/NAME.json and the blocks of all pages. Returns the written files."""
    return publish(name, {"conditions": machine_conditions(), **results}, Page(blocks))
