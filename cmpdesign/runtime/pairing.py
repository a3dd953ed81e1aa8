"""Frames of several cameras, and results of several sensors, that belong together by time."""

from __future__ import annotations

from collections.abc import Sequence

from cmpdesign.runtime.camera import CameraFrame

HALF = 0.5 + 1e-6  # of a frame time, within which frames belong together


def newest_set(
    histories: Sequence[Sequence[CameraFrame]], after: int, frame_s: float | None
) -> tuple[CameraFrame, ...] | None:
    """One frame of each camera: the first camera's newest one that has partners, and these; None without a new one.

    Args:
        histories: the newest frames of each camera, the newest last.
        after: number of the first camera's frame that was read last.
        frame_s: time from frame to frame; partners differ by at most half of it. None: by any time.
    """
    within_s = float("inf") if frame_s is None else HALF * frame_s
    for first in reversed(histories[0]):
        if first.number <= after:
            return None
        partners = [
            min(others, key=lambda one: abs(one.taken_s - first.taken_s), default=None)
            for others in histories[1:]
        ]
        found = tuple(one for one in partners if one and abs(one.taken_s - first.taken_s) <= within_s)
        if len(found) == len(partners):
            return (first, *found)
    return None


def nearest_places(times_s: Sequence[Sequence[float]]) -> list[int] | None:
    """The place of one time in each list: those nearest to the newest time that all lists have reached; None where a
    list is empty.
    """
    if not all(times_s):
        return None
    common_s = min(max(each) for each in times_s)
    return [min(range(len(each)), key=lambda k: abs(each[k] - common_s)) for each in times_s]
