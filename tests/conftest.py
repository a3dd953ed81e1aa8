"""What pytest hands to the tests of every folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.layouts import small_text


@pytest.fixture
def layout_file(tmp_path: Path) -> Path:
    path = tmp_path / "layout.json"
    path.write_text(small_text(), encoding="utf-8")
    return path
