"""The door of a live server: it tests from where a connection comes, and hands the bytes on.

A web page that is open in a browser may connect to any port of this machine; the browser states the page's address in
``Origin`` (RFC 6455, section 10.2). A page whose own name was made to point to this machine (DNS rebinding) states that
name in ``Host``. Foxglove's server tests neither; it listens at an address that no page knows, behind this door.
"""

from __future__ import annotations

import secrets
import socket
from collections.abc import Mapping
from contextlib import suppress
from socketserver import BaseRequestHandler, ThreadingTCPServer
from threading import Thread
from urllib.parse import urlsplit

from cmpdesign.errors import CmpDesignError, parameter

HEAD_BYTES = 16384  # of a request; browsers send some hundred
HEAD_S = 5.0  # until a request is complete
_CHUNK_BYTES = 1 << 18
_HERE = frozenset({"localhost", "127.0.0.1", "::1"})
_VIEWERS = frozenset({"app.foxglove.dev", "app.foxglove.com"})


def hidden_address() -> str:
    """An address of this machine that nobody can guess, where all of 127.0.0.0/8 is this machine; else 127.0.0.1."""
    numbers = [secrets.randbelow(254) + 1 for _ in range(3)]
    address = "127." + ".".join(map(str, numbers))
    with suppress(OSError), socket.socket() as probe:
        probe.bind((address, 0))
        return address
    return "127.0.0.1"


def why_refused(head: bytes) -> str:
    """Why a request is refused; "" for a request of a program, of a viewer's page, or of a page of this machine."""
    lines = head.decode("latin-1").split("\r\n")
    fields: dict[str, list[str]] = {}
    for line in lines[1:]:
        name, _, value = line.partition(":")
        fields.setdefault(name.strip().lower(), []).append(value.strip())
    if not lines[0].startswith("GET ") or "websocket" not in ",".join(fields.get("upgrade", [])).lower():
        return "expected a request for a websocket"
    hosts, origins = fields.get("host", []), fields.get("origin", [])
    if len(hosts) != 1 or _host_of(f"//{hosts[0]}") not in _HERE:
        return "Host is not this machine"
    if len(origins) > 1 or not all(map(_is_known_page, origins)):
        return "Origin is a web page that is not known"
    return ""


def _is_known_page(origin: str) -> bool:
    """Pages of this machine, of Foxglove, and of its program; "null" is any page in a frame."""
    scheme, host = origin.partition("://")[0], _host_of(origin)
    if scheme == "file":
        return origin == "file://"
    return (scheme in ("http", "https") and host in _HERE) or (scheme == "https" and host in _VIEWERS)


def _host_of(address: str) -> str | None:
    with suppress(ValueError):
        return urlsplit(address).hostname
    return None


class _Door(ThreadingTCPServer):
    daemon_threads = True
    allow_reuse_address = True
    block_on_close = False
    inner: tuple[str, int]


class _Visit(BaseRequestHandler):
    """One connection."""

    server: _Door

    def handle(self) -> None:
        with suppress(OSError):
            self.request.settimeout(HEAD_S)
            head, rest = _read_head(self.request)
            reason = why_refused(head)
            if reason:
                self.request.sendall(_refusal(reason))
                return
            with socket.create_connection(self.server.inner, HEAD_S) as inner:
                for one in (self.request, inner):
                    one.settimeout(None)
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                inner.sendall(head + rest)
                back = Thread(target=_hand_on, args=(inner, self.request), daemon=True)
                back.start()
                _hand_on(self.request, inner)
                back.join()


def _read_head(client: socket.socket) -> tuple[bytes, bytes]:
    """A request up to its empty line, and what came after it; no head if it is too long or incomplete."""
    data = b""
    while len(data) <= HEAD_BYTES:
        more = client.recv(4096)
        data += more
        head, end, rest = data.partition(b"\r\n\r\n")
        if end:
            return head + end, rest
        if not more:
            break
    return b"", b""


def _hand_on(source: socket.socket, target: socket.socket) -> None:
    """All bytes until one side ends, and then the end."""
    with suppress(OSError):
        while data := source.recv(_CHUNK_BYTES):
            target.sendall(data)
    for one in (source, target):
        with suppress(OSError):
            one.shutdown(socket.SHUT_RDWR)


def _refusal(reason: str) -> bytes:
    text = f"{reason}\n".encode()
    fields: Mapping[str, object] = {
        "Content-Type": "text/plain",
        "Content-Length": len(text),
        "Connection": "close",
    }
    lines = "".join(f"{name}: {value}\r\n" for name, value in fields.items())
    return f"HTTP/1.1 403 Forbidden\r\n{lines}\r\n".encode() + text


class Gate:
    """The door in front of a server.

    Args:
        port: a free port on this machine.
        inner: address and port of the server.

    Raises:
        CmpDesignError: the port cannot be opened.
    """

    def __init__(self, host: str, port: int, inner: tuple[str, int]) -> None:
        try:
            self._door = _Door((host, port), _Visit)
        except OSError as error:
            raise CmpDesignError(
                f"{parameter('live_port')} {port}: cannot be opened ({error.strerror or error})"
            ) from None
        self._door.inner = inner
        self.port: int = self._door.server_address[1]
        Thread(target=self._door.serve_forever, args=(0.1,), name="gate", daemon=True).start()

    def close(self) -> None:
        """Take no more connections; the server ends those that there are."""
        self._door.shutdown()
        self._door.server_close()
