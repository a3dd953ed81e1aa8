"""Image files as a source, with times by their names, by their count, or by a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median

import numpy as np

from cmpdesign.errors import SourceError, parameter
from cmpdesign.files.images import Image, ImageFileError, full_range, range_of, read_stored, used_values
from cmpdesign.inputs.cameras import CameraState
from cmpdesign.inputs.frame_names import NS_PER_S, NamedTimes, read_names
from cmpdesign.tracking.sources.frame_source import Reading, SourceFrame, SourceTimes
from cmpdesign.tracking.sources.time_table import TimeTable

DEFAULT_FPS = 30.0
_MAX_FPS = 1e5


class ImagesSource:
    """Image files in a given order.

    Args:
        paths: the files.
        name: name for messages.
        how: ``fps``: rate at which frames, or the numbers in names, are counted; None: 30.
        times: "names", "index", a table, or None: what the names say, else the index.
        left_out: number of files that are no frames.

    Raises:
        SourceError: times by names that carry none.
    """

    is_live = False

    def __init__(
        self,
        paths: Sequence[Path],
        name: str,
        how: Reading,
        times: str | TimeTable | None = None,
        left_out: int = 0,
    ) -> None:
        self._paths, self._how, fps = tuple(paths), how, how.fps
        self.name, self.ended_early = name, ""
        self._used, self._bits = 0, 16
        self.camera: tuple[CameraState, ...] = ()
        self.total: int | None = len(self._paths)
        self._times_s, self.times = _times(self._paths, fps or DEFAULT_FPS, fps is not None, times, name)
        steps_s = [b - a for a, b in zip(self._times_s, self._times_s[1:], strict=False) if b > a]
        step_s = median(steps_s) if steps_s and self.times.of in ("names", "table") else 0.0
        self.fps: float | None = 1 / step_s if step_s > 1 / _MAX_FPS else fps or DEFAULT_FPS
        if left_out:
            text = f"{self.times.text}; {left_out} files are left out: hidden, empty or cut off"
            self.times = SourceTimes(**(vars(self.times) | {"text": text}))

    def frames(self) -> Iterator[SourceFrame]:
        for time_s, path in zip(self._times_s, self._paths, strict=True):
            try:
                yield SourceFrame(time_s, self._read(path), path=path)
            except ImageFileError as error:
                yield SourceFrame(time_s, None, str(error), path)

    def _read(self, path: Path) -> Image:
        """A picture; values of fewer bits than 16 are scaled by all pictures so far, so that light stays comparable."""
        pixels = read_stored(path, self._how.max_pixels)
        if pixels.dtype != np.uint16:
            return pixels
        place = range_of(pixels, path, self._how.bits, self._used)
        self._used, self._bits = self._used | used_values(pixels), place.bits
        return full_range(pixels, place)

    @property
    def notes(self) -> list[str]:
        if self._bits == 16 or self._how.bits is not None:
            return []
        return [
            f"the pictures hold values of {self._bits} bits in 16, which are scaled to the whole range; where all "
            f"pictures are dark, state the camera's bits with {parameter('bits')}"
        ]


def _times(
    paths: Sequence[Path], fps: float, is_given: bool, wanted: str | TimeTable | None, name: str
) -> tuple[list[float], SourceTimes]:
    if isinstance(wanted, TimeTable):
        times_s = [wanted.time_s(index, path.name) for index, path in enumerate(paths)]
        if all(time_s != time_s for time_s in times_s):
            raise SourceError(
                f"{wanted.path}: has no time for any picture of {name}, neither by name nor by number"
            )
        return times_s, table_times(wanted)
    named = None if wanted == "index" else read_names(paths)
    if named is not None and any(a >= b for a, b in zip(named.values, named.values[1:], strict=False)):
        named = None  # the pictures were given in another order
    if named is None and wanted == "names":
        raise SourceError(
            f"{name}: the names carry no times; expected one number that rises from name to name, as in frame7.png or "
            f"1700000000.123.png; use {parameter('times', 'index')}, or {parameter('times')} with a file .csv"
        )
    rate = f"{fps:g} per second ({parameter('fps') if is_given else 'the default of ' + parameter('fps')})"
    if named is None:
        text = f"times: counted at {rate}, by the order of {len(paths)} pictures"
        return [index / fps for index in range(len(paths))], SourceTimes("index", text)
    if named.kind == "numbers":
        first, missing = named.values[0], named.missing
        gaps = f", {missing} numbers are missing" if missing else ""
        text = f"times: by the numbers in {len(paths)} names at {rate}{gaps}"
        origin = ("frame number", first / fps)
        return [(n - first) / fps for n in named.values], SourceTimes("numbers", text, origin=origin)
    return _times_of_stamps(named)


def _times_of_stamps(named: NamedTimes) -> tuple[list[float], SourceTimes]:
    first = named.values[0]
    times_s = [(value - first) / NS_PER_S for value in named.values]
    if named.kind == "seconds":
        text = f"times: the seconds in {len(times_s)} names"
        return times_s, SourceTimes("names", text, origin=("seconds in names", first / NS_PER_S))
    began_s = first / NS_PER_S
    text = f"times: the stamps in {len(times_s)} names, since 1970"
    return times_s, SourceTimes("names", text, began_s, "names", origin=("unix", began_s))


def table_times(table: TimeTable) -> SourceTimes:
    """How times of a table are found."""
    began_s = table.began_s if table.is_unix else None
    kind = "unix" if table.is_unix else "table"
    return SourceTimes(
        "table",
        f"times: from {table.path}",
        began_s,
        None if began_s is None else "table",
        origin=(kind, table.began_s),
    )
