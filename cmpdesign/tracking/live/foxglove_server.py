"""Foxglove's server: the messages of a recording, on the same topics, over a websocket."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.libraries import extra
from cmpdesign.tracking.live.gate import Gate, hidden_address
from cmpdesign.tracking.live.options import HOST
from cmpdesign.tracking.recording.frames import ImagePlace, RecordedFrame
from cmpdesign.tracking.recording.topics import TopicMessages

# Messages that wait for one viewer; then the oldest message is left out. With images, 4 messages a frame, some 32 MB.
BACKLOG_MESSAGES = 256
CLOSE_S = 0.5  # time for viewers to receive the waiting messages
SUBSCRIBE_S = 0.05  # from a viewer's first subscription to its others
POLL_S = 0.01
_LOGGER = "foxglove"
_FULL = "full"  # in the library's log line on a full outbox


def require_foxglove() -> Any:
    """The module foxglove.

    Raises:
        MissingLibraryError: it is not installed.
    """
    with extra("live"):
        import foxglove
    return foxglove


class FoxgloveServer:
    """Serves frames to viewers that the gate lets in.

    Args:
        has_contact: coordinate frame of a sensor's markers, which is the first part of all its topics but the
            diagnostics' -> whether its frames hold a contact.
        port: a free port on this machine.
        places: places of the shown images. All topics exist before a client can connect: to a connected client,
            the library may offer a topic before it accepts subscriptions to the topic.

    Raises:
        CmpDesignError: a library is not installed, or the port cannot be opened.
    """

    def __init__(self, has_contact: Mapping[str, bool], port: int, places: Iterable[ImagePlace] = ()) -> None:
        self._foxglove = require_foxglove()
        self._messages = {frame_id: TopicMessages(frame_id) for frame_id in has_contact}
        self._context = self._foxglove.Context()
        self._channels: dict[str, Any] = {}
        for frame_id, messages in self._messages.items():
            for topic, kind in messages.kinds(places, has_contact[frame_id]).items():
                self._channel(topic, kind)
        self._watch, inner = _watch_log(self._foxglove), hidden_address()
        try:
            self._server = self._foxglove.start_server(
                name=f"cmpdesign: {', '.join(has_contact)}",
                host=inner,
                port=0,
                context=self._context,
                message_backlog_size=BACKLOG_MESSAGES,
            )
        except RuntimeError as error:
            raise CmpDesignError(f"{parameter('live')} foxglove: cannot be opened ({error})") from None
        try:
            self._gate = Gate(HOST, port, (inner, self._server.port))
        except CmpDesignError:
            self._server.stop()
            raise
        self.address = f"ws://{HOST}:{self._gate.port}"

    def wait(self, seconds: float) -> bool:
        """Wait until a viewer has subscribed to a topic."""
        end = time.monotonic() + seconds
        while not self._is_watched() and time.monotonic() < end:
            time.sleep(POLL_S)
        if self._is_watched():
            time.sleep(SUBSCRIBE_S)
        return self._is_watched()

    def _is_watched(self) -> bool:
        return any(channel.base.has_sinks() for channel in self._channels.values())

    def send(self, frames: Sequence[RecordedFrame], frame_id: str | None = None) -> None:
        """Send frames of a sensor; None: of the only one."""
        messages = self._messages[next(iter(self._messages)) if frame_id is None else frame_id]
        for frame in frames:
            for one in messages.of(frame):
                self._channel(one.topic, one.kind).log(bytes(one.data), log_time=one.ns)

    def is_behind(self) -> bool:
        return self._watch.is_behind

    def close(self) -> None:
        if self._is_watched():
            time.sleep(CLOSE_S)
        self._gate.close()
        self._server.stop()
        for channel in self._channels.values():
            channel.close()
        logging.getLogger(_LOGGER).removeHandler(self._watch)

    def _channel(self, topic: str, kind: str) -> Any:
        if topic not in self._channels:
            text, _ = next(iter(self._messages.values())).store.generate_msgdef(kind, ros_version=2)
            schema = self._foxglove.Schema(name=kind, encoding="ros2msg", data=text.encode())
            self._channels[topic] = self._foxglove.Channel(
                topic, message_encoding="cdr", schema=schema, context=self._context
            )
        return self._channels[topic]


class _Watch(logging.Handler):
    """Detects viewers whose outbox is full: the library reports this in its log only, without a count."""

    is_behind = False

    def emit(self, record: logging.LogRecord) -> None:
        if "outbox" in record.getMessage() and _FULL in record.getMessage():
            self.is_behind = True


def _watch_log(foxglove: Any) -> _Watch:
    """Read the library's log, and keep the log off the terminal."""
    watch, logger = _Watch(), logging.getLogger(_LOGGER)
    logger.addHandler(watch)
    logger.propagate = False
    logger.setLevel(logging.INFO)
    with _unchanged_root():
        foxglove.set_log_level("INFO")
    return watch


@contextmanager
def _unchanged_root() -> Iterator[None]:
    """The program's own log is not changed: ``set_log_level`` gives it a handler."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    try:
        yield
    finally:
        root.handlers[:] = handlers
        root.setLevel(level)
