"""Every command of the page on laser jobs runs unchanged."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner

from cmpdesign.cli import app
from cmpdesign.design.laser_options import LaserOptions
from cmpdesign.products.laser.coupon.design import load_coupon
from cmpdesign.products.laser.library import machines, materials
from tests.support.laser_tools import coupon_photo

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "laser.md"


def test_the_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^(?:    |\$ )cmpdesign (.+)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        if command.startswith("kerf"):
            _, file, picture = shlex.split(command)
            piece = load_coupon(file)
            cv2.imwrite(picture, coupon_photo(piece, {patch.name: (0.15, 0.14) for patch in piece.patches}))
        result = CliRunner().invoke(app, shlex.split(command))
        assert result.exit_code == 0, f"{command}: {result.output}"
    assert (tmp_path / "out" / "laser" / "5-outline.gcode").is_file()


def test_every_option_and_file_is_on_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in [*LaserOptions.model_fields, *machines(), *materials()]:
        assert f"`{name}`" in text, name
