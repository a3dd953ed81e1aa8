"""Cameras and streams as sources: frames while they are taken, with the camera's time stamps or times of arrival."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import Any

from cmpdesign.errors import SourceError, parameter
from cmpdesign.files.images import ImageFileError, decode_bytes
from cmpdesign.inputs.cameras import CameraSettings, CameraState, set_camera
from cmpdesign.inputs.files import MAX_PIXELS
from cmpdesign.inputs.sources import has_jpeg_end, without_password
from cmpdesign.inputs.videos import CUT_OFF, decoded_frames, opened_stream, packets_of
from cmpdesign.tracking.sources.frame_source import SourceFrame, SourceTimes

MAX_FAILED_READS = 10  # consecutive failures after which a camera counts as ended
MAX_DELAY_S = 1.0  # from a camera's time stamp to the arrival; a longer time means stamps of another clock
MAX_LEAD_S = 0.5  # of stamps before the arrival; frames that wait at the start explain less than that
_ARRIVAL = "times: of arrival, because"


class LiveClock:
    """Times of a live source's frames, s from the first one: the camera's time stamps, or times of arrival.

    A stamp is used where it is later than the previous frame, and not long before the arrival; some drivers give no
    stamps. Stamps shortly before their arrival are on our clock, as Linux has them. Of others the least delay so far is
    the camera's clock against ours, as a frame cannot arrive before it is taken. Stamps that run ahead of it by
    ``MAX_LEAD_S`` are no clock, and times are those of arrival from then on.
    """

    def __init__(self) -> None:
        self._start_s: float | None = None
        self._offset_s: float | None = None
        self._first_offset_s = 0.0
        self._last_s = -1.0
        self._has_stamps = True
        self.times = SourceTimes("arrival", f"{_ARRIVAL} no stamps came from the camera", is_doubtful=False)

    def time_s(self, stamp_s: float, now_s: float) -> float:
        """The time of a frame; ``stamp_s``: on the camera's clock, NaN without an image; ``now_s``: of its arrival."""
        if self._start_s is None:
            self._start_s = stamp_s if 0 <= now_s - stamp_s < MAX_DELAY_S else now_s
            began_s = time.time() - (now_s - self._start_s)
            origin = ("arrival", self._start_s)
            self.times = replace(self.times, began_unix_s=began_s, began_of="clock", origin=origin)
        time_s = now_s - self._start_s
        if self._has_stamps and stamp_s == stamp_s:
            time_s = self._by_stamp_s(stamp_s, time_s)
        self._last_s = max(time_s, self._last_s)
        return self._last_s

    def _by_stamp_s(self, stamp_s: float, arrival_s: float) -> float:
        if self._offset_s is None:
            start_s = self._start_s or 0.0
            is_ours = 0 <= arrival_s + start_s - stamp_s < MAX_DELAY_S
            self._offset_s = self._first_offset_s = -start_s if is_ours else arrival_s - stamp_s
        self._offset_s = min(self._offset_s, arrival_s - stamp_s)
        if self._first_offset_s - self._offset_s > MAX_LEAD_S:
            self._has_stamps = False
            text = f"{_ARRIVAL} the stamps of the source run ahead of them"
            self.times = replace(self.times, of="arrival", text=text, camera_clock_s=None)
            return arrival_s
        by_camera_s = stamp_s + self._offset_s
        if by_camera_s <= self._last_s or arrival_s - by_camera_s >= MAX_DELAY_S:
            return arrival_s
        if stamp_s > 0 and self.times.of != "camera":
            text = "times: the camera's stamps, from the first frame"
            self.times = replace(self.times, of="camera", text=text, camera_clock_s=-self._offset_s)
        return by_camera_s


class StreamSource:
    """A network stream by its address.

    Args:
        address: as "rtsp://user:password@host/path".
        most_pixels: limit of width x height of a frame.

    Raises:
        SourceError: the stream cannot be opened.
    """

    is_live = True

    def __init__(self, address: str, most_pixels: int = MAX_PIXELS) -> None:
        self.name, self.ended_early = f"stream {without_password(address)}", ""
        self._open = ExitStack()
        self._container = self._open.enter_context(opened_stream(address, self.name, most_pixels))
        self.total: int | None = None
        self.fps: float | None = None
        self._clock = LiveClock()
        self.notes: list[str] = []
        self.camera: tuple[CameraState, ...] = ()

    @property
    def times(self) -> SourceTimes:
        return self._clock.times

    def frames(self) -> Iterator[SourceFrame]:
        """Frames until the stream stops."""
        index = 0
        with self._open:
            for frame in decoded_frames(self._container, packets_of(self._container)):
                time_s = self._clock.time_s(frame.time_s, time.monotonic())
                yield SourceFrame(time_s, frame.image, frame.problem)
                index += 1
        self.ended_early = f"the stream stopped after {index} frames"


class CameraSource:
    """A camera, read by OpenCV.

    A camera that sends JPEG, as most do by USB, is asked for the bytes: a frame that is cut off has no image, where
    OpenCV would show what there is.

    Args:
        capture: OpenCV's reader of the open camera.
        name: name for messages.
        most_pixels: limit of width x height of a frame.
        settings: what is asked of the camera.

    Raises:
        SourceError: the frames are too large, or a setting cannot be asked for.
    """

    is_live = True

    def __init__(self, capture: Any, name: str, most_pixels: int, settings: CameraSettings) -> None:
        import cv2

        self._capture = capture
        state = set_camera(capture, settings, name)
        _require_frame_size(state, name, most_pixels)
        self._most_pixels = most_pixels
        self._is_jpeg = state.sends_jpeg and bool(capture.set(cv2.CAP_PROP_CONVERT_RGB, 0))
        self.name, self.ended_early = name, ""
        self.total: int | None = None
        self.fps: float | None = None
        self.notes = [f"{name}: {note}" for note in state.notes()]
        self.camera: tuple[CameraState, ...] = (state,)
        self._clock = LiveClock()

    @property
    def times(self) -> SourceTimes:
        return self._clock.times

    def frames(self) -> Iterator[SourceFrame]:
        """Frames until the camera stops."""
        import cv2

        failed, index = 0, 0
        try:
            while failed < MAX_FAILED_READS:
                read = self._read()
                has_frame = read is not None
                stamp_s = float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1e3 if has_frame else float("nan")
                time_s = self._clock.time_s(stamp_s, time.monotonic())
                failed = 0 if has_frame else failed + 1
                yield (
                    self._frame(time_s, read)
                    if has_frame
                    else SourceFrame(time_s, None, "the camera gave no image")
                )
                index += 1
        finally:
            self._capture.release()
        self.ended_early = f"the camera stopped after {index - failed} frames"

    def _read(self) -> Any:
        """What OpenCV gives; None without a frame, also where it fails on a driver's answer."""
        import cv2

        with suppress(cv2.error):
            success, read = self._capture.read()
            return read if success else None
        return None

    def _frame(self, time_s: float, read: Any) -> SourceFrame:
        if not self._is_jpeg:
            return SourceFrame(time_s, read)
        data = read.tobytes()
        if not has_jpeg_end(data):
            return SourceFrame(time_s, None, CUT_OFF)
        try:
            image = decode_bytes(data, "the camera's JPEG", self._most_pixels)
        except ImageFileError as error:
            return SourceFrame(time_s, None, str(error))
        return SourceFrame(time_s, image)


def _require_frame_size(state: CameraState, name: str, most_pixels: int) -> None:
    """Raise ``SourceError`` for declared frames of more than ``most_pixels`` pixels."""
    width, height = state.settings.camera_size or (0, 0)
    if width * height > most_pixels:
        raise SourceError(
            f"{name}: the frames have {width} x {height} px; the limit is {most_pixels / 1e6:.4g} megapixels "
            f"({parameter('max_pixels')})"
        )


def open_camera(number: int, name: str, most_pixels: int, settings: CameraSettings) -> CameraSource:
    """Open a camera by its number, without OpenCV's messages on stderr.

    Raises:
        SourceError: the camera cannot be opened, or its frames are too large.
    """
    import cv2

    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        capture = cv2.VideoCapture(number, cv2.CAP_ANY)
        if not capture.isOpened():
            raise SourceError(
                f"{name} cannot be opened; check that it is connected and that no other program uses it; "
                "the command cameras lists the cameras"
            )
        return CameraSource(capture, name, most_pixels, settings)
    finally:
        cv2.utils.logging.setLogLevel(level)
