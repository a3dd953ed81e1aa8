"""Small layouts and their documents for several test files, made once."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from cmpdesign.design.design import load_design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from extractor import __file__ as EXTRACTOR_FILE

SCHEMA_PATH = Path(EXTRACTOR_FILE).parent / "layout.schema.json"  # shipped with the package
PATTERNS = ("honeycomb", "round", "elliptical", "square")


@cache
def small_layout(pattern: str = "honeycomb", layers: int = 2) -> Layout:
    return build_layout(load_design(pattern, {"layers": str(layers), "pitch_mm": "1.5"}))


@cache
def small_text(pattern: str = "honeycomb", layers: int = 2) -> str:
    return layout_to_json(small_layout(pattern, layers))


def small_document(pattern: str = "honeycomb", layers: int = 2) -> dict[str, Any]:
    """A fresh copy, free to be damaged."""
    document: dict[str, Any] = json.loads(small_text(pattern, layers))
    return document


def layout_schema() -> dict[str, Any]:
    schema: dict[str, Any] = json.loads(SCHEMA_PATH.read_text(encoding="utf-8"))
    return schema
