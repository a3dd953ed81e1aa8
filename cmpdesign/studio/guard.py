"""The door of the server: which requests are answered, and the headers of every answer.

A page of another origin can send requests to a server on this machine, and a name that resolves to 127.0.0.1 (DNS
rebinding) makes it the same origin. So the Host must be one of the server's own names, the Origin must be the server's
own, and a token, which the program prints, must come with every request: first in the address, then in a cookie.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs, urlsplit

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": _POLICY,
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(self), microphone=(), geolocation=()",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}
_SEEN_TOKEN = "open the address that the program printed: it holds the token of this run"


@dataclass(frozen=True)
class Door:
    """What a request must show.

    Attributes:
        host: the address that the server listens on.
        port: the port.
        token: the secret of this run.
    """

    host: str
    port: int
    token: str

    @property
    def address(self) -> str:
        """The page's address with the token, for a browser on this machine."""
        host = "127.0.0.1" if self._is_everywhere else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/?token={self.token}"

    @property
    def cookie(self) -> str:
        """The cookie's name; cookies of other ports of this machine come with every request, too."""
        return f"cmpdesign-{self.port}"

    @property
    def _is_everywhere(self) -> bool:
        return self.host in ("0.0.0.0", "::")

    def is_own(self, authority: str) -> bool:
        """True for "name:port" of this server. A foreign name is refused, even if it resolves to this machine."""
        try:
            parts = urlsplit(f"//{authority}")
            name, port = parts.hostname or "", parts.port or 80
        except ValueError:
            return False
        names = {"localhost", "127.0.0.1", "::1", self.host.lower(), socket.gethostname().lower()}
        return port == self.port and (name in names or (self._is_everywhere and _is_number(name)))

    def refusal(self, scope: Any) -> str:
        """Why a request is not answered; "" if it may enter."""
        pairs = [(name.decode("latin-1"), value.decode("latin-1")) for name, value in scope["headers"]]
        headers = dict(pairs)
        host, origins = headers.get("host", ""), [value for name, value in pairs if name == "origin"]
        if not self.is_own(host):
            return "this is not the name of the server; use the address that the program printed"
        if any(origin != f"http://{host}" for origin in origins):
            return "requests of other pages are refused"
        if scope["type"] == "websocket" and not origins:
            return "a connection of no page is refused"
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        given += _cookies(headers.get("cookie", ""), self.cookie)
        if not any(hmac.compare_digest(one.encode(), self.token.encode()) for one in given):
            return _SEEN_TOKEN
        return ""


class Guard:
    """ASGI middleware that refuses, before the application sees a request, what ``Door`` refuses."""

    def __init__(self, app: Any, door: Door) -> None:
        self._app, self._door = app, door

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._door.refusal(scope)
        if scope["type"] == "websocket":
            if refusal:
                await send({"type": "websocket.close", "code": 1008, "reason": refusal})
            else:
                await self._app(scope, receive, send)
            return

        async def send_guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *_encoded(HEADERS.items())]
            await send(message)

        if refusal:
            body = json.dumps({"error": refusal}).encode()
            await _answer(send_guarded, 403, {"content-type": "application/json"}, body)
        elif scope["method"] == "GET" and b"token=" in scope["query_string"]:
            cookie = f"{self._door.cookie}={self._door.token}; Path=/; HttpOnly; SameSite=Strict"
            await _answer(send_guarded, 303, {"location": scope["path"], "set-cookie": cookie}, b"")
        else:
            await self._app(scope, receive, send_guarded)


async def _answer(send: Any, status: int, headers: dict[str, str], body: bytes) -> None:
    await send({"type": "http.response.start", "status": status, "headers": _encoded(headers.items())})
    await send({"type": "http.response.body", "body": body})


def _encoded(headers: Iterable[tuple[str, str]]) -> list[tuple[bytes, bytes]]:
    return [(name.encode("latin-1"), value.encode("latin-1")) for name, value in headers]


def _cookies(header: str, name: str) -> list[str]:
    pairs = (part.strip().partition("=") for part in header.split(";"))
    return [value for key, _, value in pairs if key == name]


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
