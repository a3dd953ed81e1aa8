"""The page on laser jobs names every option and file."""

from __future__ import annotations

from pathlib import Path

from cmpdesign.design.laser_options import LaserOptions
from cmpdesign.products.laser.library import machines, materials

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "laser.md"


def test_every_option_and_file_is_on_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in [*LaserOptions.model_fields, *machines(), *materials()]:
        assert f"`{name}`" in text, name
