"""Connections to the live server that no viewer makes: pages of other machines, rebound names, and bytes at random."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from cmpdesign.tracking.live.foxglove_server import FoxgloveServer
from tests.support.tracking.foxglove_client import Received, open_client, take

ASK = "GET / HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
KEY = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    server = FoxgloveServer({"tactile": False}, 0)
    yield int(server.address.rpartition(":")[2])
    server.close()


def answer(port: int, request: bytes) -> bytes:
    """All that the server sends until it ends the connection, or the first bytes of a websocket."""
    with socket.create_connection(("127.0.0.1", port), 10) as client:
        client.sendall(request)
        return client.recv(65536)


def asked(port: int, *fields: str) -> bytes:
    return answer(port, (ASK + KEY + "".join(f"{field}\r\n" for field in fields) + "\r\n").encode("latin-1"))


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "http://evil.example:8765",
        "null",
        "https://app.foxglove.dev.evil.example",
        "http://app.foxglove.dev",
        "https://localhost.evil.example",
        "https://[::1",
        "file://host/page.html",
        "",
    ],
)
def test_a_web_page_gets_nothing(port: int, origin: str) -> None:
    assert b"403 Forbidden" in asked(port, "Host: 127.0.0.1", f"Origin: {origin}")


@pytest.mark.parametrize(
    "fields",
    [
        ("Host: evil.example",),
        ("Host: evil.example:8765", "Origin: http://evil.example:8765"),
        ("Host: 127.0.0.1", "Host: evil.example"),
        ("Host: localhost", "Origin: http://localhost", "Origin: https://evil.example"),
        (),
    ],
)
def test_a_rebound_name_gets_nothing(port: int, fields: tuple[str, ...]) -> None:
    assert b"403 Forbidden" in asked(port, *fields)


@pytest.mark.parametrize(
    "origin", [None, "https://app.foxglove.dev", "http://localhost:8080", "http://127.0.0.1", "file://"]
)
def test_a_viewer_is_let_in(port: int, origin: str | None) -> None:
    fields = () if origin is None else (f"Origin: {origin}",)
    assert b"101 Switching Protocols" in asked(port, f"Host: localhost:{port}", *fields)


def test_bytes_at_random_end_no_server(port: int) -> None:
    rng = np.random.default_rng(3)
    for length in (0, 1, 100, 5000, 40_000):
        with suppress(OSError):
            assert b"101" not in answer(port, rng.bytes(length) + b"\r\n\r\n")
    with open_client(port) as client:
        received = Received()
        take(client, received, 10)


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="needs /proc to list what listens")
def test_the_inner_server_is_at_no_address_that_a_page_knows(port: int) -> None:
    """Browsers name this machine 127.0.0.1 or localhost; the server itself listens elsewhere in 127.0.0.0/8."""
    own = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            own.add(str(link.readlink()))
    rows = [row.split() for row in Path("/proc/self/net/tcp").read_text(encoding="utf-8").splitlines()[1:]]
    listening = {row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own}
    assert f"0100007F:{port:04X}" in listening and len(listening) == 2
    (inner,) = (address for address in listening if not address.startswith("0100007F"))
    assert inner[6:8] == "7F"
