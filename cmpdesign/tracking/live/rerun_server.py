"""Rerun's server: the entities of a .rrd file, for viewers that connect."""

from __future__ import annotations

import time
from collections.abc import Sequence

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.tracking.live.options import HOST
from cmpdesign.tracking.recording.frames import RecordedFrame
from cmpdesign.tracking.recording.rerun_rows import APPLICATION, RerunRows, require_rerun

MEMORY = "128MiB"  # of frames for viewers that connect later; then the oldest frames are left out
CLOSE_S = 0.5  # time for viewers to take the last frames
FLUSH_S = 5.0


class RerunServer:
    """Serves frames, and keeps the last frames for viewers that connect later.

    Args:
        frame_id: the coordinate frame of the markers, and the first part of all entities but the diagnostics'.
        port: a free port on this machine.

    Raises:
        CmpDesignError: the library is not installed, or the port cannot be opened.
    """

    def __init__(self, frame_id: str, port: int) -> None:
        rerun = require_rerun()
        self._stream = rerun.RecordingStream(APPLICATION)
        try:
            sink = rerun.GrpcServerSink(HOST, port, server_memory_limit=MEMORY)
            self._stream.set_sinks(sink)
        except RuntimeError as error:
            raise CmpDesignError(f"{parameter('live_port')} {port}: cannot be opened ({error})") from None
        self._rows = RerunRows(frame_id)
        self.address = f"rerun+http://{HOST}:{port}/proxy"

    def wait(self, seconds: float) -> bool:
        """No wait: a viewer that connects later gets the earlier frames."""
        return True

    def send(self, frames: Sequence[RecordedFrame]) -> None:
        for one in self._rows.of(frames):
            self._stream.send_columns(one.entity, one.timelines, one.columns, strict=True)

    def is_behind(self) -> bool:
        """Not known: a viewer gets the frames that the server's memory still holds."""
        return False

    def close(self) -> None:
        try:
            self._stream.flush(timeout_sec=FLUSH_S)
            time.sleep(CLOSE_S)
        finally:
            self._stream.disconnect()
