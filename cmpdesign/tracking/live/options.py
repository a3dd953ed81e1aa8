"""The kind and the port of a live server."""

from __future__ import annotations

import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, get_args

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.tracking.recording.frames import RecordedFrame

HOST = "127.0.0.1"  # this machine only; there is no other choice, because there is no password
LiveKind = Literal["foxglove", "rerun"]
# The viewers' own ports.
PORTS: Mapping[LiveKind, int] = {"foxglove": 8765, "rerun": 9876}


@dataclass(frozen=True)
class Live:
    """Options of a live server.

    Attributes:
        kind: the viewer.
        port: the port on this machine; None: the viewer's own port; 0: any free port.
        wait_s: waiting time of the first frame for a viewer of Foxglove, s.

    Raises:
        CmpDesignError: no such viewer, no such port, or no such time.
    """

    kind: LiveKind
    port: int | None = None
    wait_s: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in get_args(LiveKind):
            raise CmpDesignError(
                f"{parameter('live')} {self.kind!r}: unknown viewer; expected foxglove or rerun"
            )
        if self.port is not None and not 0 <= self.port < 1 << 16:
            raise CmpDesignError(
                f"{parameter('live_port')} {self.port}: expected a number from 0, for any free port, to 65535"
            )
        if not 0 <= self.wait_s < float("inf"):
            raise CmpDesignError(
                f"{parameter('live_wait_s')} {self.wait_s:g}: expected a number of seconds from 0"
            )
        if self.wait_s and self.kind == "rerun":
            raise CmpDesignError(
                f"{parameter('live_wait_s')}: Rerun's server keeps the frames for a viewer that connects later; "
                "leave it out"
            )

    def free_port(self) -> int:
        """The port, if no other program uses it.

        Raises:
            CmpDesignError: another program uses the port.
        """
        port = PORTS[self.kind] if self.port is None else self.port
        try:
            with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind((HOST, port))
                free: int = probe.getsockname()[1]
                return free
        except OSError as error:
            raise CmpDesignError(
                f"{parameter('live_port')} {port}: cannot be opened ({error.strerror or error}); "
                "end the program that uses it, or give another port"
            ) from None


class Server(Protocol):
    """A server of frames; only one thread calls it.

    Attributes:
        address: address for the viewer.
    """

    address: str

    def wait(self, seconds: float) -> bool:
        """Wait for a viewer; True if a viewer is connected."""
        ...

    def send(self, frames: Sequence[RecordedFrame]) -> None:
        """Send frames to all viewers; frames that a viewer does not receive in time are left out."""
        ...

    def is_behind(self) -> bool:
        """True if a viewer did not receive all messages so far."""
        ...

    def close(self) -> None:
        """Wait until viewers have received the last frames, or for a short time, and stop."""
        ...
