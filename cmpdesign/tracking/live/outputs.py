"""A run's file and its live view, opened together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from cmpdesign.tracking.columns import FrameTable
from cmpdesign.tracking.live.options import Live
from cmpdesign.tracking.live.view import LiveView, open_view
from cmpdesign.tracking.recording.options import Recording, is_recording
from cmpdesign.tracking.sinks.tables import FrameSink, open_sink


class Outputs(NamedTuple):
    """The outputs of a run's frames; ``live`` is None without a live view."""

    sink: FrameSink
    live: LiveView | None


def open_outputs(path: Path, table: FrameTable, recording: Recording, live: Live | None) -> Outputs:
    """Open the live server, if wanted, and then the file: if the server fails, no file is made.

    Args:
        path: see ``open_sink``.
        table: the frames' columns.
        recording: options; the images are also shown live, also where the file is a table without images.
        live: the live server's options.

    Raises:
        CmpDesignError, OutputError: see ``open_sink`` and ``open_view``.
    """
    if live is None:
        return Outputs(open_sink(path, table, recording), None)
    view = open_view(live, table, recording)
    kept = recording if is_recording(path) else replace(recording, with_images=False)
    try:
        return Outputs(open_sink(path, table, kept), view)
    except BaseException:
        view.close()
        raise
