"""Fixtures for the tests of every folder."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

# Before numpy is imported: threads of two workers would wait for each other with busy processors.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from typer.main import get_command

from tests.support.layouts import small_text

# Typer makes all commands anew for every call, which takes longer than most calls.
pytest.MonkeyPatch().setattr("typer.testing._get_command", cache(get_command))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest test starts first, so that no worker waits for it at the end."""
    items.sort(key=lambda item: item.get_closest_marker("longest") is None)


@pytest.fixture
def layout_file(tmp_path: Path) -> Path:
    path = tmp_path / "layout.json"
    path.write_text(small_text(), encoding="utf-8")
    return path
