"""The server of the page: its guard, and its documents against the calls of Python and the command line."""

from __future__ import annotations

import io
import re
import socket
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any

import pytest
from starlette.testclient import TestClient

import cmpdesign
from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import to_png
from cmpdesign.products.drawing.svg import layout_to_svg
from cmpdesign.studio.app import PAGE, make_app
from cmpdesign.studio.guard import Door
from cmpdesign.studio.serving import serve

DOOR = Door("127.0.0.1", 8300, "the-token-of-this-run")
HOME = "http://127.0.0.1:8300"
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


# -- pictures


def test_a_picture_is_read_as_the_call_reads_it(page: TestClient) -> None:
    design = cmpdesign.Design(**FIELDS)
    image = cmpdesign.render(design.layout, pitch_px=30, rotation_deg=20, noise=1).image
    expected = cmpdesign.verify(design.layout, image)
    query = {"fields": '{"pattern": "honeycomb", "layers": 3, "pitch_mm": "60mil"}', "name": "seen.png"}
    found = page.post("/api/readings", params=query, content=to_png(image)).json()
    assert found["verified"] and found["measured"] == expected.measured == len(found["ids"])
    assert found["xy"] == expected.markers.xy_px[found["ids"]].round(3).tolist()
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
