"""``python -m tools.figures.screens [FOLDER]``: pictures of the studio's page, as an installed Chromium shows it.

Without a folder the pictures of the documentation are written; with one, all parts at all widths, to be looked at.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2

import cmpdesign
from benchmarks.studio.page import browser, served
from benchmarks.studio.sensor import write_touched_sensor

SCREENS = Path(__file__).resolve().parents[2] / "docs" / "screens"
WIDTHS = {360: 780, 1280: 800, 3840: 2160}  # width -> height of the window, px
SHOWN = {  # width -> pictures of the documentation
    360: ("read", "touch"),
    1280: ("start", "design", "laser", "make", "read", "unread", "touch"),
    3840: ("design",),
}
COLORS = 128
BLUR_PX = 6


def main(arguments: list[str]) -> None:
    """Write all pictures."""
    folder = Path(arguments[0]) if arguments else SCREENS
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="cmpdesign-screens-") as name, browser() as running:
        made = Path(name)
        words = write_touched_sensor(made)
        sharp = cmpdesign.render(cmpdesign.load("tac3d").layout, noise=2).image
        cv2.imwrite(str(made / "out-of-focus.png"), cv2.GaussianBlur(sharp, (0, 0), BLUR_PX))
        for width, height in WIDTHS.items():

            def keep(page: Any, part: str, width: int = width) -> None:
                if arguments or part in SHOWN[width]:
                    _write(page, folder / f"studio-{part}{'' if width == 1280 else f'-{width}'}.png")

            page = running.new_page(viewport={"width": width, "height": height})
            with served() as address:
                page.goto(address)
                _walk(page, made / "out-of-focus.png", keep)
            with served("view", words[0], str(made / "frames"), *words[1:]) as address:
                page.goto(f"{address}#/touch")
                page.wait_for_selector("text=the source has ended")
                keep(page, "touch")
            page.close()


def _walk(page: Any, blurred: Path, keep: Callable[[Any, str], None]) -> None:
    """Go through the parts that need no camera; ``blurred``: a picture that is not read."""
    page.wait_for_load_state("networkidle")
    page.click("button:text-is('Propose a pad')")
    page.wait_for_selector("text=Open this design")
    keep(page, "start")
    page.click(".card:has(b:text-is('tac3d'))")
    page.wait_for_selector(".stage svg path.white")
    page.fill("#f-pitch_mm", "0.5")
    page.keyboard.press("Enter")
    page.wait_for_selector(".finding.warning")
    keep(page, "design")
    page.click("#undo")
    page.click("nav >> text=Make")
    page.click("text=Laser paths")
    page.wait_for_selector("path.cut")
    page.locator("input[aria-label='Time of the job']").fill("0.6")
    keep(page, "laser")
    page.click("#theme")
    for name in ("preview", "mesh", "print"):
        page.set_checked(f"input[name={name}]", name != "preview")
    page.click("button:text-is('Build')")
    page.wait_for_selector("text=Download all", timeout=600_000)
    page.click(".bar >> text=Print sheet")
    page.wait_for_timeout(1000)
    keep(page, "print")
    page.click(".bar >> text=Mold in 3-D")
    page.wait_for_selector(".parts input[type=range]")
    page.locator(".parts input[type=range]").first.fill("0.5")
    keep(page, "make")
    page.click("#theme")
    page.click("nav >> text=Read")
    page.click("text=own picture")
    page.wait_for_selector(".finding.good")
    page.focus(".canvas svg")
    for _ in range(4):
        page.keyboard.press("+")
    page.wait_for_timeout(1000)
    keep(page, "read")
    page.set_input_files("#picture", blurred)
    page.wait_for_selector(".finding.error")
    page.wait_for_timeout(1000)
    keep(page, "unread")


def _write(page: Any, path: Path) -> None:
    """A screenshot with few colors, which makes it small."""
    from PIL import Image

    page.mouse.move(0, 0)
    page.wait_for_timeout(500)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
