"""The page in a real browser: an installed Chromium, driven by Playwright, against a running ``cmpdesign studio``."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

import cmpdesign
from benchmarks.studio.page import browser, chromium, options, served
from benchmarks.studio.sensor import write_touched_sensor
from cmpdesign.products.drawing.svg import layout_to_svg
from tests.support.tracking.live_messages import unpacked

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="no Chromium is installed: apt-get install chromium"),
]
TO_SCREEN = """([x, y]) => {
    const to = new DOMPoint(x, y).matrixTransform(document.querySelector(".canvas svg").getScreenCTM());
    return [to.x, to.y];
}"""
SMALL_TEXTS = """() => [...document.querySelectorAll("body *")].filter((one) =>
    [...one.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim())
    && !one.closest("svg") && parseFloat(getComputedStyle(one).fontSize) < 12).map((one) => one.outerHTML)"""
SHIFTS = """window.shifts = [];
    const told = (one) => [one.value, ...one.sources.map(({ node }) => node?.outerHTML?.slice(0, 90))];
    new PerformanceObserver((list) => list.getEntries().filter((one) => !one.hadRecentInput)
        .forEach((one) => window.shifts.push(told(one)))).observe({ type: "layout-shift", buffered: true });"""
ATTACK = """async (home) => {
    const request = { method: "POST", mode: "no-cors", credentials: "include", body: "{}" };
    try { return (await fetch(home + "/api/builds", request)).type; } catch { return "refused"; }
}"""
TOO_LARGE = "async () => (await fetch('/api/toml', { method: 'POST', body: '#'.repeat(1 << 21) })).status"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served() as found:
        yield found


@pytest.fixture(scope="module")
def chrome() -> Iterator[Any]:
    with browser() as running:
        yield running


@pytest.fixture
def page(chrome: Any, address: str) -> Iterator[Any]:
    """A new page at the start; it must end without an error in its console and without a foreign request."""
    shown = chrome.new_page(viewport={"width": 1280, "height": 800})
    problems: list[str] = []
    home = address.partition("/?")[0]
    shown.on("pageerror", lambda error: problems.append(str(error)))
    shown.on("console", lambda line: problems.append(line.text) if is_problem(line) else None)
    shown.on("request", lambda one: None if one.url.startswith((home, "blob:")) else problems.append(one.url))
    shown.goto(address)
    shown.wait_for_selector(".card")
    yield shown
    shown.close()
    assert problems == []


def is_problem(line: Any) -> bool:
    """True for an error that is not the browser's own line on a refused request."""
    return line.type == "error" and "422" not in line.text


def open_template(page: Any, name: str) -> None:
    page.click(f".card:has(b:text-is('{name}'))")
    page.wait_for_selector(".stage svg path.white", state="attached")


def wait_for_markers(page: Any, count: int) -> None:
    page.wait_for_selector(f".note:text-matches('^{count} markers')")


def drawn(page: Any) -> dict[str, str]:
    """Color -> path of the drawing."""
    script = "all => Object.fromEntries(all.map(one => [one.getAttribute('class'), one.getAttribute('d')]))"
    return dict(page.eval_on_selector_all(".stage svg > path", script))


def written(design: cmpdesign.Design) -> dict[str, str]:
    groups = re.findall(r'<g fill="[^"]+" id="(\w+)">(.*?)</g>', layout_to_svg(design.layout))
    return {name: "".join(re.findall(r' d="([^"]+)"', group)) for name, group in groups}


def test_a_changed_parameter_draws_what_the_command_line_writes(page: Any) -> None:
    open_template(page, "tac3d")
    assert drawn(page) == written(cmpdesign.load("tac3d"))
    page.locator("input[aria-label='layers, slider']").fill("7")
    wait_for_markers(page, 169)
    assert drawn(page) == written(cmpdesign.load("tac3d", layers=7))
    page.click("#undo")
    wait_for_markers(page, 331)
    page.keyboard.press("Control+Shift+Z")
    wait_for_markers(page, 169)
    page.reload()  # the design is in the address
    wait_for_markers(page, 169)
    assert drawn(page) == written(cmpdesign.load("tac3d", layers=7))


def test_a_finding_stands_at_its_field_and_the_button_removes_it(page: Any) -> None:
    open_template(page, "honeycomb")
    page.fill("#f-pitch_mm", "0.3")
    page.keyboard.press("Enter")
    page.wait_for_selector(".field.warning:has(#f-pitch_mm)")
    page.click(".finding.warning:has-text('smallest cell') >> text=Apply the remedy")
    page.wait_for_selector(".finding.good")
    assert 0.51 < float(page.input_value("#f-pitch_mm")) < 0.56
    page.fill("#f-width_mm", "30")
    page.keyboard.press("Enter")
    page.wait_for_selector(".finding.error:has-text('fix the size twice')")


def test_a_build_is_byte_equal_to_the_command_line(page: Any, tmp_path: Path) -> None:
    open_template(page, "honeycomb")
    page.click("nav >> text=Make")
    page.check("input[name=laser]")
    page.click("button:text-is('Build')")
    page.wait_for_selector("text=Download all", timeout=120_000)
    with page.expect_download() as download:
        page.click("text=Download all")
    archive = zipfile.ZipFile(download.value.path())
    (tmp_path / "design.toml").write_bytes(archive.read("design.toml"))
    words = ["build", "design.toml", "-o", "made", "--only", "svg,layout,preview,report,laser"]
    command = [sys.executable, "-m", "cmpdesign", *words]
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, check=False).returncode == 0
    files = [path for path in (tmp_path / "made").rglob("[!.]*") if path.is_file()]
    made = {path.relative_to(tmp_path / "made").as_posix(): path.read_bytes() for path in files}
    assert set(archive.namelist()) == {"design.toml", *made} and len(made) > 30
    assert {name: archive.read(name) for name in made} == made


def test_a_build_is_canceled_and_its_files_are_gone(page: Any) -> None:
    open_template(page, "tac3d")
    page.click("nav >> text=Make")
    page.check("input[name=mold]")
    page.click("button:text-is('Build')")
    page.wait_for_selector(".job .log:has-text('begins')", timeout=60_000)
    page.click("text=Cancel")
    page.wait_for_selector(".job b:text-is('Canceled')")
    page.wait_for_timeout(1000)
    assert page.locator("text=Download all").count() == 0


def test_good_and_bad_pictures(page: Any, tmp_path: Path) -> None:
    layout = cmpdesign.load("tac3d").layout
    rendered = cmpdesign.render(layout, pitch_px=22, rotation_deg=11, noise=2, seed=3)
    cv2.imwrite(str(tmp_path / "seen.png"), rendered.image)
    (tmp_path / "words.png").write_text("no picture")
    other = cmpdesign.render(cmpdesign.load("honeycomb", layers=4).layout, noise=2).image
    cv2.imwrite(str(tmp_path / "other.png"), other)
    open_template(page, "tac3d")
    page.click("nav >> text=Read")
    page.set_input_files("#picture", tmp_path / "seen.png")
    page.wait_for_selector(".finding.good:has-text('331 of 331')")
    page.mouse.click(*page.evaluate(TO_SCREEN, rendered.truth.marker_xy_px[217].tolist()))
    page.wait_for_selector("h2:text-is('Marker 217')")
    page.set_input_files("#picture", tmp_path / "words.png")
    page.wait_for_selector(".finding.error:has-text('words.png: is not an image')")
    page.set_input_files("#picture", tmp_path / "other.png")
    page.wait_for_selector(".finding.error:has-text('Not verified')")
    assert page.locator(".stages button").count() > 3


def test_two_stills_are_compared_and_another_layout_is_read(page: Any, tmp_path: Path) -> None:
    layout, other = cmpdesign.load("tac3d").layout, cmpdesign.load("honeycomb", layers=5).layout
    for name, press_mm in (("rest", 0.0), ("pressed", 0.3)):
        image = cmpdesign.render(layout, pitch_px=22, press_mm=press_mm, noise=1, seed=3).image
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    cv2.imwrite(str(tmp_path / "other.png"), cmpdesign.render(other, noise=1).image)
    open_template(page, "tac3d")
    page.click("nav >> text=Read")
    page.set_input_files("#picture", tmp_path / "rest.png")
    page.wait_for_selector(".finding.good:has-text('331 of 331')")
    page.click("button:text-is('This is rest')")
    page.set_input_files("#picture", tmp_path / "pressed.png")
    page.wait_for_selector(".note:has-text('from rest.png: largest 0.3 mm')")
    assert page.get_attribute("path.arrows", "d").count("M") == 2 * 331
    with page.expect_download() as download:
        page.click("text=Save as track does")
    download.value.save_as(tmp_path / "run.npz")
    assert cmpdesign.load_run(tmp_path / "run.npz").arrays["displacement_mm"].shape == (2, 331, 2)
    page.click("text=Other layout")
    page.fill("dialog textarea", other.to_json())
    page.click("text=Take over")
    page.wait_for_selector("text=Read with: honeycomb, 91 markers")
    page.set_input_files("#picture", tmp_path / "other.png")
    page.wait_for_selector(".finding.good:has-text('91 of 91')")


def test_200_frames_of_a_camera_against_the_truth(chrome: Any, address: str, tmp_path: Path) -> None:
    """Chromium's camera is a file of rendered frames; the page's markers are compared with the frames' truth."""
    layout = cmpdesign.load("tac3d").layout
    rendered = [cmpdesign.render(layout, pitch_px=18, press_mm=0.1 * k, noise=1, seed=k) for k in range(6)]
    jpegs = [cv2.imencode(".jpg", one.image, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes() for one in rendered]
    (tmp_path / "camera.mjpeg").write_bytes(b"".join(jpegs))
    truth = np.stack([one.truth.marker_xy_px for one in rendered])
    frames: list[dict[str, Any]] = []
    with chrome.browser_type.launch(**options(tmp_path / "camera.mjpeg")) as with_camera:
        page = with_camera.new_page()
        page.on(
            "websocket",
            lambda socket: socket.on("framereceived", partial(keep_frame, frames)),
        )
        page.goto(address)
        open_template(page, "tac3d")
        page.click("nav >> text=Touch")
        page.click("text=Use the camera of this browser")
        while len(frames) < 200:
            page.wait_for_timeout(200)
        assert re.search(r"frame \d+", page.inner_text(".note"))
    errors = []
    for frame in frames[:200]:
        assert frame["tracked"] and frame["measured"] > 320, frame["reason"]
        distance = np.linalg.norm(frame["place"] - truth[:, frame["ids"]], axis=2)
        errors.append(distance[distance.mean(axis=1).argmin()])
    assert np.concatenate(errors).max() < 2.0  # no marker under another's id; a JPEG of a JPEG
    assert np.sqrt(np.mean(np.concatenate(errors) ** 2)) < 0.3


def test_a_camera_without_a_right_and_a_source_of_view(chrome: Any, address: str, tmp_path: Path) -> None:
    page = chrome.new_page()
    page.goto(address)
    page.wait_for_selector(".card")
    page.click("nav >> text=Touch")
    page.click("text=Use the camera of this browser")
    page.wait_for_selector(".note:has-text('no camera that the browser can use')")
    page.close()
    design = cmpdesign.load("honeycomb", layers=5)
    design.layout.write(tmp_path / "layout.json")
    for k in range(8):
        cv2.imwrite(
            f"{tmp_path}/{k}.png", cmpdesign.render(design.layout, press_mm=0.1 * k, noise=1, seed=k).image
        )
    with served("view", f"{tmp_path}/layout.json", f"{tmp_path}", "-o", f"{tmp_path}/run.npz") as live:
        page = chrome.new_page()
        page.goto(f"{live}#/touch")
        page.wait_for_selector(".note:has-text('the source has ended')")
        assert "91 of 91" in page.inner_text("aside")
        page.close()
    assert len(cmpdesign.load_run(tmp_path / "run.npz").arrays["displacement_mm"]) == 8
    assert (tmp_path / "run.npz.summary.json").exists()


def test_a_surface_under_a_ball_is_shown_and_turned(chrome: Any, tmp_path: Path) -> None:
    """The pressed cells are red, a key turns the surface, and the force is that of the frame in words."""
    words = write_touched_sensor(tmp_path, frames=4, layers=5)
    frames: list[dict[str, Any]] = []
    with served("view", words[0], f"{tmp_path}/frames", *words[1:]) as live:
        page = chrome.new_page()
        page.on("websocket", lambda socket: socket.on("framereceived", partial(keep_frame, frames)))
        page.goto(f"{live}#/touch")
        page.wait_for_selector(".note:has-text('the source has ended')")
        surface = page.locator("canvas[aria-label^='The surface']")
        shown = [pixels_of(surface)]
        for key in ("ArrowRight", "-"):
            surface.press(key)
            shown.append(pixels_of(surface))
        told = page.inner_text("aside")
        page.close()
    last = frames[-1]
    assert last["in_space"] and last["rest"] == b"" and last["place"].shape == (len(last["ids"]), 3)
    assert last["contact"]["force_n"][2] < -0.05 and f"{last['contact']['force_n'][2]:.3f} ±" in told
    assert re.search(r"Age when shown\s+\d+ ms", told)
    strongest = last["place"][last["pressure_mpa"].argmax()]
    assert np.hypot(*strongest[:2]) < 2.0  # the ball presses at the centre
    drawn = [pixels[..., 3] > 0 for pixels in shown]
    assert drawn[0].mean() > 0.1 and drawn[2].sum() < 0.8 * drawn[1].sum()
    assert (shown[1] != shown[0]).any(axis=2).mean() > 0.05


def pixels_of(canvas: Any) -> Any:
    """(H, W, 4) of a canvas."""
    url = canvas.evaluate("one => one.toDataURL()")
    return cv2.imdecode(
        np.frombuffer(base64.b64decode(url.partition(",")[2]), np.uint8), cv2.IMREAD_UNCHANGED
    )


def keep_frame(frames: list[dict[str, Any]], data: Any) -> None:
    if isinstance(data, bytes):
        frames.append(unpacked(data))


def assert_is_in_order(page: Any, width: int, part: str) -> None:
    """No violation by axe-core, nothing wider than the window, no text below 12 px."""
    found = Axe().run(page)
    assert found.violations_count == 0, f"{part}: {found.generate_report()}"
    assert page.evaluate("document.documentElement.scrollWidth") <= width, part
    assert page.evaluate(SMALL_TEXTS) == [], part


@pytest.mark.parametrize(("width", "theme"), [(360, "dark"), (1280, "light"), (3840, "dark")])
def test_sizes_contrast_and_names(chrome: Any, address: str, tmp_path: Path, width: int, theme: str) -> None:
    """Every part, with results and errors in it, by axe-core: names, contrast, order of headings, and the rest."""
    other = cmpdesign.render(cmpdesign.load("honeycomb", layers=4).layout, noise=2).image
    cv2.imwrite(str(tmp_path / "other.png"), other)
    page = chrome.new_page(viewport={"width": width, "height": 900}, color_scheme=theme)
    page.add_init_script(SHIFTS)
    page.goto(address)
    page.click("button:text-is('Propose a pad')")
    page.wait_for_selector("text=Open this design")
    assert page.evaluate("document.documentElement.dataset.theme") == theme
    assert_is_in_order(page, width, "start")
    open_template(page, "tac3d")
    page.fill("#f-pitch_mm", "0.5")
    page.keyboard.press("Enter")
    page.wait_for_selector(".finding.warning")
    assert_is_in_order(page, width, "design")
    page.click("#undo")
    page.click("nav >> text=Make")
    page.click("text=Laser paths")
    page.wait_for_selector("path.cut")
    assert_is_in_order(page, width, "make")
    page.click("nav >> text=Read")
    page.click("text=own picture")
    page.wait_for_selector(".finding.good")
    assert_is_in_order(page, width, "read")
    page.set_input_files("#picture", tmp_path / "other.png")
    page.wait_for_selector(".finding.error:has-text('Not verified')")
    assert_is_in_order(page, width, "an unread picture")
    page.click("nav >> text=Touch")
    page.wait_for_selector("text=No camera of this machine", state="attached")
    assert_is_in_order(page, width, "touch")
    assert page.evaluate("window.shifts") == []
    page.close()


def test_a_foreign_page_gets_nothing(chrome: Any, address: str) -> None:
    """A page of another origin of this machine, in a browser that knows the token's cookie."""
    context = chrome.new_context()
    own, home = context.new_page(), address.partition("/?")[0]
    own.goto(address)
    own.wait_for_selector(".card")
    with served() as other:
        stranger = context.new_page()
        stranger.goto(other)
        stranger.wait_for_selector(".card")
        assert stranger.evaluate(ATTACK, home) == "refused"
    answer = context.request.post(f"{home}/api/builds", headers={"Origin": "http://127.0.0.1:1"}, data="{}")
    assert answer.status == 403 and "other pages" in json.loads(answer.text())["error"]
    assert own.evaluate(TOO_LARGE) == 413
    context.close()
