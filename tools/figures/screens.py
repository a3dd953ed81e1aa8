"""``python -m tools.figures.screens``: write the pictures of the studio's page, as an installed Chromium shows it."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

from benchmarks.studio.page import browser, served

SCREENS = Path(__file__).resolve().parents[2] / "docs" / "screens"
COLORS = 128


def main() -> None:
    """Write all pictures."""
    with served() as address, browser() as running:
        page = running.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.wait_for_load_state("networkidle")
        _write(page, "studio-start")
        page.click(".card:has(b:text-is('tac3d'))")
        page.wait_for_selector(".stage svg path.white")
        page.fill("#f-pitch_mm", "0.5")
        page.keyboard.press("Enter")
        page.wait_for_selector(".finding.warning")
        _write(page, "studio-design")
        page.click("#undo")
        page.click("#theme")
        page.click("nav >> text=Make")
        page.uncheck("input[name=preview]")
        page.check("input[name=mesh]")
        page.click("button:text-is('Build')")
        page.wait_for_selector("text=Download all", timeout=600_000)
        page.wait_for_selector(".parts input[type=range]")
        page.locator(".parts input[type=range]").first.fill("0.5")
        _write(page, "studio-make")
        page.click("#theme")
        page.click("nav >> text=Read")
        page.click("text=Read the design")
        page.wait_for_selector(".finding.good")
        page.focus(".canvas svg")
        for _ in range(4):
            page.keyboard.press("+")
        page.wait_for_timeout(1000)
        _write(page, "studio-read")


def _write(page: Any, name: str) -> None:
    """A screenshot with few colors, which makes it small."""
    from PIL import Image

    page.mouse.move(0, 0)
    page.wait_for_timeout(500)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    SCREENS.mkdir(exist_ok=True)
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(SCREENS / f"{name}.png", optimize=True)
    sys.stdout.write(f"docs/screens/{name}.png\n")


if __name__ == "__main__":
    main()
