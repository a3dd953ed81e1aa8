"""Measured figures of the documentation: JSON files in docs/measured, and blocks of pages written from these.

A block of a page stands between ``<!-- NAME: written by make bench -->`` and ``<!-- end of NAME -->``. The text
between these lines is replaced; all other text is kept.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.frame.conditions import ROOT
from cmpdesign.files.atomic import write_file

MEASURED_FOLDER, IMAGES = ROOT / "docs" / "measured", ROOT / "docs" / "images"
BLOCK_BEGIN, BLOCK_END = "<!-- {}: written by make bench -->", "<!-- end of {} -->"


@dataclass(frozen=True)
class Page:
    """What the documentation shows of an experiment, made from its content of docs/measured alone.

    Attributes:
        blocks: name -> text of a block.
        pictures: name in docs/images -> content.
    """

    blocks: Mapping[str, str] = field(default_factory=dict)
    pictures: Mapping[str, bytes] = field(default_factory=dict)


def replace_blocks(text: str, blocks: Mapping[str, str]) -> str:
    """The page with the text of its blocks replaced.

    Raises:
        ValueError: a block has no end, or begins twice.
    """
    for name, lines in blocks.items():
        begin, end = BLOCK_BEGIN.format(name), BLOCK_END.format(name)
        if begin not in text:
            continue
        before, _, rest = text.partition(begin)
        _, ends, after = rest.partition(end)
        if not ends:
            raise ValueError(f"the block {name} has no end; write {end!r} at its end")
        if begin in after:
            raise ValueError(f"the block {name} occurs twice; remove one of them")
        text = f"{before}{begin}\n\n{lines.strip()}\n\n{end}{after}"
    return text


def updated_pages(blocks: Mapping[str, str]) -> dict[Path, str]:
    """README and the pages of docs/ with one of the blocks: path -> text with replaced blocks."""
    found = {}
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        text = path.read_text(encoding="utf-8")
        if any(BLOCK_BEGIN.format(name) in text for name in blocks):
            found[path] = replace_blocks(text, blocks)
    return found


def json_text(results: Mapping[str, Any], *, is_sorted: bool = False) -> str:
    """JSON of results, with null for every float that JSON has no text for: NaN and infinities."""
    return json.dumps(_plain(results), indent=1, sort_keys=is_sorted) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def measured_path(name: str) -> Path:
    return MEASURED_FOLDER / f"{name}.json"


def read_measured(name: str) -> dict[str, Any]:
    """The content of docs/measured/NAME.json; empty if the experiment was never published."""
    path = measured_path(name)
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def publish(name: str, results: Mapping[str, Any], page: Page) -> list[Path]:
    """Write docs/measured/NAME.json, the pictures, and the blocks of all pages. Returns the written files."""
    new: dict[Path, str | bytes] = {measured_path(name): json_text(results, is_sorted=True)}
    new |= {IMAGES / image: data for image, data in page.pictures.items()}
    new |= {
        path: text
        for path, text in updated_pages(page.blocks).items()
        if text != path.read_text(encoding="utf-8")
    }
    for path, content in new.items():
        write_file(path, content)
    return list(new)
