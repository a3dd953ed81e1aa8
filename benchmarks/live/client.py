"""A viewer in a separate process, for ``benchmarks.live``: a client of Foxglove's websocket protocol.

    python -m benchmarks.live.client PORT [--stalled]

The client subscribes to all channels, reads until the server stops, and prints the number of received clouds of
markers. With --stalled the client subscribes, and does not read until its input ends.
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import suppress

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

PROTOCOL = "foxglove.sdk.v1"


def connected(port: int) -> ClientConnection:
    """The connection, as soon as there is a server."""
    for _ in range(200):
        with suppress(ConnectionRefusedError):
            url = f"ws://127.0.0.1:{port}"
            return connect(
                url,
                subprotocols=[PROTOCOL],
                max_size=None,
                max_queue=4,
                close_timeout=1,
                ping_interval=None,
                legacy=True,
            )
        time.sleep(0.05)
    raise SystemExit("there is no server")


def main(arguments: list[str]) -> None:
    """Connect, subscribe, read, count."""
    clouds, markers = 0, -1
    with connected(int(arguments[0])) as client, suppress(ConnectionClosed):
        for message in client:
            if isinstance(message, bytes):
                clouds += int.from_bytes(message[1:5], "little") == markers
                continue
            channels = json.loads(message).get("channels", [])
            if channels:
                markers = next(one["id"] for one in channels if one["topic"].endswith("/markers"))
                wanted = [{"id": one["id"], "channelId": one["id"]} for one in channels]
                client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                if "--stalled" in arguments:
                    sys.stdin.read()
                    break
    print(clouds)


if __name__ == "__main__":
    main(sys.argv[1:])
