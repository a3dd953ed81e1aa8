"""The server of the page: its guard, and its documents against the calls of Python and the command line."""

from __future__ import annotations

import io
import json
import re
import socket
import time
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

import cmpdesign
from cmpdesign.api.sequences import track_job
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import to_png
from cmpdesign.products.drawing.svg import layout_to_svg
from cmpdesign.products.laser.coupon.design import coupon_to_json, design_coupon
from cmpdesign.products.laser.grid.design import design_grid
from cmpdesign.products.laser.setup import complete_setup
from cmpdesign.studio.app import PAGE, make_app
from cmpdesign.studio.builds import MAX_RUNNING, Builds
from cmpdesign.studio.guard import Door
from cmpdesign.studio.live import LiveFeed
from cmpdesign.studio.pictures import RESIDUAL_SIGMAS, residual_picture
from cmpdesign.studio.serving import serve
from extractor import Extractor
from tests.support.laser_tools import coupon_photo
from tests.support.tracking.live_messages import unpacked

DOOR = Door("127.0.0.1", 8300, "the-token-of-this-run")
HOME, SOCKETS = "http://127.0.0.1:8300", "ws://127.0.0.1:8300"
FIELDS = {"pattern": "honeycomb", "layers": 3, "pitch_mm": "60mil"}


@pytest.fixture(scope="module")
def page() -> Iterator[TestClient]:
    with TestClient(make_app(DOOR), base_url=HOME) as client:
        assert client.get(DOOR.address.removeprefix(HOME)).status_code == 200
        yield client


def refused(page: TestClient, address: str, **request: Any) -> str:
    answer = page.post(address, **request)
    assert answer.status_code == 422, answer.text
    return str(answer.json()["error"])


# -- the guard


@pytest.mark.parametrize(
    ("headers", "address", "said"),
    [
        ({"host": "rebound.example:8300"}, "/?token=the-token-of-this-run", "not the name of the server"),
        ({"host": "127.0.0.1:9999"}, "/?token=the-token-of-this-run", "not the name of the server"),
        ({"origin": "http://rebound.example"}, "/api/start", "requests of other pages"),
        ({"origin": "http://127.0.0.1:9999"}, "/api/start", "requests of other pages"),
        ({"origin": "null"}, "/api/start", "requests of other pages"),
        ({"cookie": "cmpdesign-8300=guessed"}, "/api/start", "token"),
        ({}, "/api/start", "token"),
        ({}, "/api/start?token=guessed", "token"),
    ],
)
def test_a_foreign_request_is_refused(headers: dict[str, str], address: str, said: str) -> None:
    with TestClient(make_app(DOOR), base_url=HOME) as stranger:
        answer = stranger.get(address, headers=headers, follow_redirects=False)
    assert answer.status_code == 403 and said in answer.json()["error"]
    assert "default-src 'none'" in answer.headers["content-security-policy"]


def test_the_token_becomes_a_cookie_that_scripts_and_other_sites_do_not_see() -> None:
    with TestClient(make_app(DOOR), base_url=HOME) as browser:
        answer = browser.get(DOOR.address.removeprefix(HOME), follow_redirects=False)
    assert answer.status_code == 303 and answer.headers["location"] == "/"
    assert {"HttpOnly", "SameSite=Strict"} <= set(answer.headers["set-cookie"].split("; "))


def test_a_server_for_other_machines_answers_to_numbers_and_its_own_name_only() -> None:
    everywhere = Door("0.0.0.0", 8300, "a")
    assert everywhere.is_own("192.0.2.7:8300") and everywhere.is_own(f"{socket.gethostname()}:8300")
    assert not everywhere.is_own("rebound.example:8300") and not DOOR.is_own("192.0.2.7:8300")


def test_a_used_port_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(CmpDesignError, match=rf"port {port} .*cannot be opened .*another port"):
            serve("127.0.0.1", port, pytest.fail, with_browser=False)


def test_the_page_asks_no_other_machine() -> None:
    """Its own files name no other address but namespaces and licences, and hold no inline script or style."""
    for path in PAGE.iterdir():
        text = path.read_text(encoding="utf-8")
        if path.name != "three.js":
            assert set(re.findall(r"https?://[^/\"')]+", text)) <= {"http://www.w3.org"}, path.name
    html = (PAGE / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"<style|style=|<script(?![^>]* src=)| on\w+=", html)


# -- designs


def test_the_drawing_has_the_coordinates_of_the_file(page: TestClient) -> None:
    design = cmpdesign.Design(**FIELDS)
    for mirror in (False, True):
        shown = page.post("/api/design", json={"fields": FIELDS, "back": mirror}).json()
        written = layout_to_svg(design.layout, mirror=mirror)
        drawn = dict(re.findall(r'class="(\w+)" fill="[^"]+" d="([^"]+)"', shown["svg"]))
        groups = dict(re.findall(r'<g fill="[^"]+" id="(\w+)">(.*?)</g>', written))
        assert drawn == {name: "".join(re.findall(r' d="([^"]+)"', group)) for name, group in groups.items()}
    assert shown["report"]["digest"] == design.layout.digest
    assert cmpdesign.Design(**shown["fields"]) == design


def test_the_design_as_toml_and_back(page: TestClient) -> None:
    fields = {
        **FIELDS,
        "name": 'a "b" \\ c',
        "mirrored": True,
        "palette": {"red": "#ff0000"},
        "laser": {"holes": False},
    }
    text = page.post("/api/design", json={"fields": fields}).json()["toml"]
    again = page.post("/api/toml", content=text).json()["fields"]
    assert cmpdesign.Design(**again) == cmpdesign.Design(**fields)
    extended = page.post("/api/toml", content='extends = "tac3d"\nlayers = 4').json()["fields"]
    assert (extended["layers"], extended["pitch_mm"]) == (4, cmpdesign.load("tac3d").pitch_mm)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"pitch_mm": 0.3}, "pitch_mm"),
        ({"border_mm": 0.1}, "border_mm"),
        ({"layers": 24, "pitch_mm": 1.0}, "layers"),
        ({"palette": {"green": "#c83c2d"}}, "palette.green"),
    ],
)
def test_a_finding_names_its_field_and_the_remedy_removes_it(
    page: TestClient, changes: dict[str, Any], named: str
) -> None:
    fields = {**FIELDS, **changes}
    findings = page.post("/api/design", json={"fields": fields}).json()["findings"]
    finding = next(one for one in findings if named in one["fields"])
    asked = {"fields": fields, "subject": finding["subject"]}
    ((dotted, value),) = page.post("/api/remedy", json=asked).json().items()
    table, _, field = dotted.rpartition(".")
    changed = (
        {**fields, table: {**fields.get(table, {}), field: value}} if table else {**fields, field: value}
    )
    left = [one.subject for one in cmpdesign.Design(**changed).check().findings]
    assert finding["subject"] not in left and len(left) < len(findings)


def test_refusals_in_words(page: TestClient) -> None:
    for fields, said in (
        ({"pattern": "honeycomb", "layers": 3}, "add pitch_mm or width_mm"),
        ({**FIELDS, "laser": {"machine": "/etc/passwd"}}, "names of templates only"),
        ({**FIELDS, "mold": {"base_silicone": "../x.toml"}}, "names of templates only"),
        ({**FIELDS, "extends": "/etc/passwd"}, "extends is unknown"),
        (7, "no object of fields"),
    ):
        assert said in refused(page, "/api/design", json={"fields": fields})
    assert "extends templates only" in refused(page, "/api/toml", content='extends = "../../x"')
    assert "is no JSON" in refused(page, "/api/design", content="{")
    assert "limit 12 px" in refused(page, "/api/size", json={"camera": "20x20", "view": "24x18"})
    for address in (
        "/page/..%2fapp.py",
        "/page/%2e%2e/app.py",
        "/api/templates/..%2fdesign.svg",
        "/api/nothing",
    ):
        assert page.get(address).status_code == 404, address
    assert page.post("/api/toml", content=b"#" * (1 << 20) + b"#").status_code == 413


def test_builds_are_few_and_private_and_leave_nothing() -> None:
    builds, design = Builds(), cmpdesign.Design(**FIELDS)
    running = [builds.start(design, ["layout"], (640, 480)) for _ in range(MAX_RUNNING)]
    folders = [build.folder for build in running]
    with pytest.raises(CmpDesignError, match=f"{MAX_RUNNING} builds run already"):
        builds.start(design, ["layout"], (640, 480))
    assert all(folder.stat().st_mode & 0o077 == 0 for folder in folders)
    running[0].cancel()
    assert running[0].state == "canceled" and not folders[0].exists() and running[0].files() == {}
    builds.close()
    assert not any(folder.exists() for folder in folders)


# -- pictures


def test_a_picture_is_read_as_the_call_reads_it(page: TestClient) -> None:
    design = cmpdesign.Design(**FIELDS)
    image = cmpdesign.render(design.layout, pitch_px=30, rotation_deg=20, noise=1).image
    expected = cmpdesign.verify(design.layout, image).found
    query = {"fields": '{"pattern": "honeycomb", "layers": 3, "pitch_mm": "60mil"}', "name": "seen.png"}
    found = page.post("/api/readings", params=query, content=to_png(image)).json()
    assert found["verified"] and found["measured"] == expected.measured == len(found["ids"])
    assert found["xy"] == expected.markers.xy_px[found["ids"]].round(3).tolist()
    assert found["stages"][-1] == "residual"
    for stage in ("picture", *found["stages"]):
        assert page.get(f"/api/readings/{found['key']}/{stage}.jpg").content.startswith(b"\xff\xd8")
    report = page.get(f"/api/readings/{found['key']}/report.zip").content
    assert zipfile.ZipFile(io.BytesIO(report)).read("pictures/picture.png") == to_png(image)
    said = refused(page, "/api/readings", params=query, content=b"no picture")
    assert said.startswith("seen.png: is not an image")
    bomb = bytearray(to_png(image))
    bomb[16:24] = (9_000).to_bytes(4, "big") * 2
    bomb[29:33] = zlib.crc32(bomb[12:29]).to_bytes(4, "big")
    assert "megapixels; the limit is 60" in refused(page, "/api/readings", params=query, content=bytes(bomb))


def test_residuals_are_noise_but_for_what_is_not_the_pattern() -> None:
    layout = cmpdesign.Design(**FIELDS).layout
    seen = cmpdesign.render(layout, pitch_px=40, rotation_deg=7, noise=2, size=(400, 400), seed=1)
    markers = Extractor(layout.reference()).extract(seen.image)
    x, y = np.rint(seen.truth.marker_xy_px[:2].mean(axis=0)).astype(int)
    dirty = seen.image.copy()
    cv2.circle(dirty, (int(x), int(y)), 6, (130, 120, 110), -1)
    of_noise, of_dirt = (
        residual_picture(image, layout.reference(), markers).astype(float) - 128
        for image in (seen.image, dirty)
    )
    per_sigma = 127.5 / RESIDUAL_SIGMAS
    middle = np.s_[100:300, 100:300]
    assert 0.8 < of_noise[middle].std() / per_sigma < 1.3
    disc = np.s_[y - 3 : y + 4, x - 3 : x + 4]
    assert np.abs(of_dirt[disc]).min(axis=(0, 1)).max() > 5 * per_sigma
    of_dirt[y - 8 : y + 9, x - 8 : x + 9] = 0
    assert np.abs(of_dirt - of_noise)[np.abs(of_dirt) > 0].max() < 2 * per_sigma


# -- live


def test_frames_of_the_browsers_camera_are_tracked(page: TestClient) -> None:
    """One frame after the other; displacements count from the frame at rest, until another frame is the rest."""
    design = cmpdesign.Design(**FIELDS)
    frames = [
        cmpdesign.render(design.layout, pitch_px=30, press_mm=press, noise=1, seed=1) for press in (0, 0.4)
    ]
    moved = frames[1].truth.marker_xy_px - frames[0].truth.marker_xy_px
    address = f"{SOCKETS}/live/camera?fields={json.dumps(FIELDS)}"
    with page.websocket_connect(address, headers={"origin": HOME}) as socket:
        assert socket.receive_json()["markers"] == 37
        for number, frame in enumerate(frames):
            socket.send_bytes(to_png(frame.image))
            found = unpacked(socket.receive_bytes())
            assert found["measured"] == 37 and found["tracked"]
            assert np.abs(found["place"] - frame.truth.marker_xy_px[found["ids"]]).max() < 0.3
            assert np.abs(found["moved"] - number * moved[found["ids"]]).max() < 0.3
        socket.send_text("rest")
        socket.send_bytes(to_png(frames[1].image))
        assert np.abs(unpacked(socket.receive_bytes())["moved"]).max() < 0.3
        socket.send_bytes(b"no picture")
        lost = unpacked(socket.receive_bytes())
        assert not lost["tracked"] and "is not an image" in lost["reason"] and len(lost["ids"]) == 0


@pytest.mark.parametrize("headers", [{}, {"origin": "http://rebound.example"}, {"origin": "null"}])
def test_a_foreign_websocket_is_refused(page: TestClient, headers: dict[str, str]) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        page.websocket_connect(f"{SOCKETS}/live/camera", headers=headers),
    ):
        pytest.fail("the connection is open")


def test_a_run_is_shown_and_recorded(tmp_path: Path) -> None:
    design = cmpdesign.Design(**FIELDS)
    for number in range(4):
        image = cmpdesign.render(design.layout, pitch_px=30, noise=1, seed=number).image
        (tmp_path / f"{number}.png").write_bytes(to_png(image))
    job = track_job(design.layout, tmp_path, tmp_path / "run.npz")
    run = job.prepare()
    feed = LiveFeed("frames", job.layout, is_paced=True)
    feed.follow(run).join(60)
    assert len(cmpdesign.load_run(tmp_path / "run.npz").arrays["displacement_mm"]) == 4
    with TestClient(make_app(DOOR, feed), base_url=HOME) as client:
        client.get(DOOR.address.removeprefix(HOME))
        with client.websocket_connect(f"{SOCKETS}/live/source", headers={"origin": HOME}) as socket:
            assert socket.receive_json()["name"] == "frames"
            socket.send_text("next")
            shown = unpacked(socket.receive_bytes())
            assert shown["index"] == 3 and shown["measured"] == 37 and shown["rest"].startswith(b"\xff\xd8")
            socket.send_text("next")
            assert socket.receive_json() == {"over": "the source has ended"}


# -- more than one picture


def dropped(page: TestClient, image: Any, fields: dict[str, Any] = FIELDS, **query: str) -> dict[str, Any]:
    asked = {"fields": json.dumps(fields), "name": "seen.png", **query}
    answer = page.post("/api/readings", params=asked, content=to_png(image))
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


def test_displacements_between_two_stills_and_their_table(page: TestClient, tmp_path: Path) -> None:
    """The displacement of the truth, and the table that ``track`` writes."""
    layout = cmpdesign.Design(**FIELDS).layout
    stills = [cmpdesign.render(layout, pitch_px=30, press_mm=mm, noise=1, seed=1) for mm in (0, 0.4)]
    rest, pressed = (dropped(page, still.image) for still in stills)
    moved = page.get(f"/api/readings/{pressed['key']}/moved", params={"rest": rest["key"]}).json()
    truth_px = (stills[1].truth.marker_xy_px - stills[0].truth.marker_xy_px)[pressed["ids"]]
    assert np.abs(np.array(moved["px"]) - truth_px).max() < 0.2
    assert 0.35 < moved["largest_mm"] < 0.45 and 0 < np.median(moved["sigma_px"]) < 0.02
    flat = page.get(f"/api/readings/{rest['key']}/moved").json()
    assert flat["largest_mm"] < 0.01 and flat["from"] is None
    keys = [rest["key"], pressed["key"]]
    data = page.post("/api/tracks", json={"keys": keys, "rest": rest["key"], "kind": "npz"}).content
    (tmp_path / "run.npz").write_bytes(data)
    run = cmpdesign.load_run(tmp_path / "run.npz").arrays["displacement_mm"]
    assert np.nanmax(np.linalg.norm(run[1], axis=1)) == pytest.approx(moved["largest_mm"], abs=1e-4)
    other = dropped(page, cmpdesign.render(layout, size=(500, 500), pitch_px=30, noise=1).image)
    answer = page.get(f"/api/readings/{other['key']}/moved", params={"rest": rest["key"]})
    assert answer.status_code == 422 and "differ in layout or size" in answer.json()["error"]
    assert "1 to 40 pictures" in refused(page, "/api/tracks", json={"keys": keys * 30, "kind": "npz"})
    assert "expected one of npz" in refused(page, "/api/tracks", json={"keys": keys, "kind": "../x"})


def test_a_picture_is_read_with_another_layout(page: TestClient) -> None:
    other = cmpdesign.load("honeycomb", layers=4).layout
    image = cmpdesign.render(other, pitch_px=30, noise=1).image
    opened = page.post("/api/layouts", content=other.to_json()).json()
    assert opened["about"] == "honeycomb, 61 markers"
    assert dropped(page, image, layout=opened["key"])["measured"] == 61
    assert "does not fit the layout" in dropped(page, image)["reason"]
    assert "version is missing" in refused(page, "/api/layouts", content='{"format": "cmp-layout"}')


@pytest.mark.slow
def test_a_coupon_and_a_grid_are_recognised(page: TestClient, tmp_path: Path) -> None:
    """A photo of the coupon of the design's own laser job is read as the call reads it; so is another job's, by its
    file, and a burnt grid."""
    setup = complete_setup(cmpdesign.Design(**FIELDS).laser)
    coupon, grid = design_coupon(setup), design_grid(setup)
    photo = coupon_photo(coupon, {patch.name: (0.1, 0.12) for patch in coupon.patches}, scale_px_mm=11.8)
    (tmp_path / "coupon.json").write_text(coupon_to_json(coupon), encoding="utf-8")
    (tmp_path / "seen.png").write_bytes(to_png(photo))
    expected = cmpdesign.kerf(tmp_path / "coupon.json", tmp_path / "seen.png").found.to_json(coupon)
    assert dropped(page, photo)["kerf"] == expected
    opened = page.post("/api/layouts", content=coupon_to_json(coupon)).json()
    assert opened["about"].startswith("kerf coupon")
    assert dropped(page, photo, {**FIELDS, "layers": 4}, layout=opened["key"])["kerf"] == expected
    cut = [patch for patch in grid.patches if patch.speed_mm_s <= 30]
    burnt = coupon_photo(replace(grid, patches=tuple(cut)), {patch.name: (0.15, 0.15) for patch in cut})
    assert dropped(page, burnt)["grid"]["best"] is not None


def test_a_camera_of_this_machine_is_shown_and_recorded(
    page: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = cmpdesign.render(cmpdesign.Design(**FIELDS).layout, pitch_px=30, noise=1).image

    class Camera:
        """Stands for OpenCV's reader of a camera."""

        def isOpened(self) -> bool:
            return True

        def get(self, key: int) -> float:
            sizes = {cv2.CAP_PROP_FRAME_WIDTH: 640.0, cv2.CAP_PROP_FRAME_HEIGHT: 480.0}
            return sizes.get(key, 0.0 if key == cv2.CAP_PROP_POS_MSEC else -1)

        def getBackendName(self) -> str:
            return "V4L2"

        def read(self) -> tuple[bool, Any]:
            time.sleep(0.01)
            return True, image

        def release(self) -> None:
            pass

    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: Camera())
    address = f"{SOCKETS}/live/machine?camera=0&fields={json.dumps(FIELDS)}"
    with page.websocket_connect(address, headers={"origin": HOME}) as socket:
        assert socket.receive_json()["markers"] == 37
        socket.send_text("save")
        assert "no frame was recorded" in socket.receive_json()["note"]
        socket.send_text("record npz")
        assert socket.receive_json() == {"recording": True}
        for _ in range(5):
            socket.send_text("next")
            shown = unpacked(socket.receive_bytes())
            assert shown["measured"] == 37 and shown["rest"].startswith(b"\xff\xd8")
        socket.send_text("save")
        saved = socket.receive_json()
    data = page.get(f"/api/recordings/{saved['saved']}").content
    run = np.load(io.BytesIO(data))
    assert len(run["frame"]) == saved["frames"] >= 4 and (run["status"] == 1).all()


@pytest.mark.parametrize(
    ("address", "asked", "said"),
    [
        ("design", {"fields": FIELDS, "camera": 7}, "camera: expected"),
        ("seen", {"fields": FIELDS, "camera": [99999, 99999]}, "at most 60 megapixels"),
        ("tracks", {"keys": 7, "kind": "npz"}, "keys: expected a list"),
        ("builds", {"fields": FIELDS, "products": 7}, "products: expected a list"),
    ],
)
def test_a_value_of_another_type_is_refused(page: TestClient, address: str, asked: Any, said: str) -> None:
    assert said in refused(page, f"/api/{address}", json=asked)
