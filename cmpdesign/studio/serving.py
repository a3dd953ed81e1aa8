"""The server: a socket of this machine, uvicorn, and the browser."""

from __future__ import annotations

import secrets
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.libraries import extra, require_libraries
from cmpdesign.studio.guard import Door

if TYPE_CHECKING:
    from cmpdesign.studio.live import LiveFeed

HOST, PORT = "127.0.0.1", 8300
MAX_MESSAGE_BYTES = 8 << 20  # of a websocket: one frame of a camera
MAX_CONNECTIONS = 64  # requests and websockets at once; a browser opens 6 requests a tab
BROWSER_S = 0.3  # from the start to the browser's first request


def serve(
    host: str,
    port: int,
    announce: Callable[[str], None],
    *,
    with_browser: bool = True,
    live: LiveFeed | None = None,
) -> None:
    """Serve the page until Ctrl-C.

    Args:
        host: address to listen on.
        port: port; 0: any free port.
        announce: called with the page's address, with its token, once requests are accepted.
        with_browser: also open the address in the browser.
        live: the run of the live part, if any.

    Raises:
        MissingLibraryError: the extra is not installed.
        CmpDesignError: the port cannot be opened.
    """
    require_libraries("studio", "starlette", "uvicorn", "websockets", "threadpoolctl")
    from cmpdesign.studio.app import make_app

    with extra("studio"):
        import uvicorn
        from threadpoolctl import threadpool_limits
    listening = _listen(host, port)
    door = Door(host, listening.getsockname()[1], secrets.token_urlsafe(24))
    config = uvicorn.Config(
        make_app(door, live),
        log_level="error",
        access_log=False,
        server_header=False,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_per_message_deflate=False,  # images are compressed already
        limit_concurrency=MAX_CONNECTIONS,
        timeout_graceful_shutdown=3,
    )
    announce(door.address)
    if with_browser:
        import webbrowser

        timer = Timer(BROWSER_S, webbrowser.open, [door.address + ("#/touch" if live is not None else "")])
        timer.daemon = True
        timer.start()

    class StudioServer(uvicorn.Server):
        """Ends at the first Ctrl-C and returns; uvicorn's own server raises the signal again, past all clean-up."""

        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            earlier = {one: signal.signal(one, self.handle_exit) for one in (signal.SIGINT, signal.SIGTERM)}
            try:
                yield
            finally:
                for one, handler in earlier.items():
                    signal.signal(one, handler)

    # Further threads of linear algebra wait for their next sum by computing, on the cores that the browser needs.
    with threadpool_limits(1, "blas"):
        StudioServer(config).run(sockets=[listening])


def _listen(host: str, port: int) -> socket.socket:
    """A socket that accepts requests from now on."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listening = socket.socket(family, kind, protocol)
        try:
            if hasattr(socket, "SO_EXCLUSIVEADDRUSE"):  # Windows
                listening.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
            else:
                listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(address)
            listening.listen()
        except BaseException:
            listening.close()
            raise
    except (OSError, OverflowError) as error:
        raise CmpDesignError(
            f"{parameter('port')} {port} of {host}: cannot be opened ({getattr(error, 'strerror', None) or error}); "
            "end the program that uses it, or give another port, or 0 for any free port"
        ) from None
    return listening
