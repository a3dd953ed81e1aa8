"""Frames sent to a live server by a separate thread, so that the tracker does not wait."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from threading import Condition, Thread
from typing import Any, NamedTuple

from cmpdesign.tracking.columns import FrameTable
from cmpdesign.tracking.live.options import Live, Server
from cmpdesign.tracking.recording.frames import FrameReader, image_places
from cmpdesign.tracking.recording.images import png_of
from cmpdesign.tracking.recording.options import RecordedTable, Recording

QUEUE_FRAMES = 32  # frames that wait for the thread; then the oldest frame is left out
AT_ONCE = 4  # frames that the thread processes together
END_S = 10.0  # for the frames that wait at the end


class LiveCount(NamedTuple):
    """The counts of a live server.

    Attributes:
        sent: number of sent frames.
        left_out: number of left-out frames, because making their messages took longer than tracking.
        is_viewer_behind: a viewer received fewer messages than were sent.
        failure: why the server stopped before the end; "" without a failure.
    """

    sent: int
    left_out: int
    is_viewer_behind: bool
    failure: str


class _Waiting(NamedTuple):
    frame: Any
    image: Any


class LiveView:
    """Shows frames during a run. No failure of the server ends the run.

    Args:
        server: the server.
        table: makes the frames' columns.
        with_images: show the images, too.
        wait_s: waiting time of the first frame for a viewer, s.

    Attributes:
        address: address for the viewer.
        wait_s: as given.
    """

    def __init__(
        self, server: Server, table: RecordedTable, with_images: bool = False, wait_s: float = 0.0
    ) -> None:
        self.wait_s = wait_s
        self._server, self._table, self._with_images = server, table, with_images
        self.address = server.address
        self._reader = FrameReader()
        self._queue: deque[_Waiting] = deque()
        self._changed = Condition()
        self._is_closed = False
        self._sent, self._left_out, self._failure = 0, 0, ""
        self._thread = Thread(target=self._work, name="live", daemon=True)
        self._thread.start()

    def wait(self, seconds: float) -> bool:
        """Wait for a viewer before the first frame; True if a viewer is connected."""
        return self._server.wait(seconds)

    def add(self, frame: Any, image: Any = None) -> None:
        """Give a tracked frame and its image to the thread; both must not be changed afterwards. The call returns at
        once.
        """
        with self._changed:
            self._queue.append(_Waiting(frame, image if self._with_images else None))
            if len(self._queue) > QUEUE_FRAMES:
                self._queue.popleft()
                self._left_out += 1
            self._changed.notify()

    def waiting(self) -> int:
        """The number of frames that wait for the thread."""
        return len(self._queue)

    def close(self) -> LiveCount:
        """Send the waiting frames, and stop the server; further calls have no effect."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join(END_S)
        return self.count()

    def count(self) -> LiveCount:
        """The counts so far."""
        return LiveCount(self._sent, self._left_out, self._server.is_behind(), self._failure)

    def _work(self) -> None:
        """Runs in the thread. Exceptions of the viewer's library are not known in advance, and must not end the run."""
        try:
            while some := self._next():
                self._send(some)
        except Exception as error:
            self._failure = f"{type(error).__name__}: {error}"
        try:
            self._server.close()
        except Exception as error:
            self._failure = self._failure or f"{type(error).__name__}: {error}"

    def _next(self) -> list[_Waiting]:
        """The waiting frames; without waiting frames, the next frame; empty at the end."""
        with self._changed:
            while not self._queue and not self._is_closed:
                self._changed.wait()
            return [self._queue.popleft() for _ in range(min(AT_ONCE, len(self._queue)))]

    def _send(self, some: Sequence[_Waiting]) -> None:
        pictures = {one.frame.index: one.image for one in some}

        def image_of(number: int, view: int | None) -> bytes | None:
            return png_of(pictures[number], view)

        columns, about = self._table.batch([one.frame for one in some]), self._table.about()
        self._server.send(list(self._reader.frames(columns, about, image_of)))
        self._sent += len(some)


def open_view(live: Live, table: FrameTable, recording: Recording) -> LiveView:
    """Start a server and its thread.

    Args:
        live: the server's options.
        table: the frames' columns.
        recording: the shown content; images as they would be recorded.

    Raises:
        CmpDesignError: a library is not installed, or the port cannot be opened.
    """
    shown = RecordedTable(table, recording)
    server: Server
    if live.kind == "foxglove":
        from cmpdesign.tracking.live.foxglove_server import FoxgloveServer, require_foxglove

        require_foxglove()
        about = shown.about()
        places = image_places(about, recording.is_image_one_a_view) if recording.with_images else ()
        server = FoxgloveServer({recording.frame_id: "young_mpa" in about}, live.free_port(), places)
    else:
        from cmpdesign.tracking.live.rerun_server import RerunServer
        from cmpdesign.tracking.recording.rerun_rows import require_rerun

        require_rerun()
        server = RerunServer(recording.frame_id, live.free_port())
    return LiveView(server, shown, recording.with_images, live.wait_s)
