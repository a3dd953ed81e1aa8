"""A client of Foxglove's websocket protocol: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Thread
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1  # the binary opcode of a message


@dataclass
class Received:
    """The received data of a client: the channels by their topics, and (time ns, bytes) of each topic's messages."""

    channels: dict[str, dict[str, Any]] = field(default_factory=dict)
    messages: dict[str, list[tuple[int, bytes]]] = field(default_factory=dict)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def open_client(port: int, timeout_s: float = 30) -> ClientConnection:
    """Connect as soon as there is a server."""
    end = time.monotonic() + timeout_s
    while True:
        try:
            url = f"ws://127.0.0.1:{port}"
            return connect(
                url,
                subprotocols=[SUBPROTOCOL],
                max_size=None,
                close_timeout=1,
                ping_interval=None,
                max_queue=1,
                compression=None,
                legacy=True,
            )
        except ConnectionRefusedError:
            if time.monotonic() > end:
                raise
            time.sleep(0.02)


def take(client: ClientConnection, received: Received, timeout_s: float | None = None) -> None:
    """Take one message; subscribe to every channel that the server advertises."""
    message = client.recv(timeout=timeout_s)
    if isinstance(message, bytes):
        assert message[0] == MESSAGE_DATA
        subscription, ns = int.from_bytes(message[1:5], "little"), int.from_bytes(message[5:13], "little")
        topic = next(name for name, one in received.channels.items() if one["id"] == subscription)
        received.messages.setdefault(topic, []).append((ns, message[13:]))
        return
    document = json.loads(message)
    if document["op"] == "advertise":
        received.channels |= {channel["topic"]: channel for channel in document["channels"]}
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in document["channels"]]
        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


def received_while(run: Callable[[], None], port: int) -> Received:
    """The data that a client receives during a run that serves on the port."""
    received = Received()

    def listen() -> None:
        client = open_client(port)
        with client, suppress(ConnectionClosed):
            while True:
                take(client, received)

    thread = Thread(target=listen)
    thread.start()
    run()
    thread.join(30)
    assert not thread.is_alive()
    return received
