"""A frame as messages on topics, in ROS's encoding CDR: the content of recordings and of live servers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from cmpdesign.libraries import extra
from cmpdesign.tracking.recording.frames import ImagePlace, RecordedFrame
from cmpdesign.tracking.recording.messages import (
    CAMERA,
    DIAGNOSTICS,
    IMAGE,
    POINTS,
    WRENCH,
    Messages,
    Stamp,
)

DIAGNOSTICS_TOPIC = "/diagnostics"


@dataclass(frozen=True, eq=False)
class TopicMessage:
    """A message.

    Attributes:
        topic: its topic.
        kind: the name of its type.
        ns: its time, ns.
        data: the message in CDR.
    """

    topic: str
    kind: str
    ns: int
    data: Any


def require_rosbags() -> Any:
    """The module rosbags.

    Raises:
        MissingLibraryError: it is not installed.
    """
    with extra("recording", "write .npz or .csv"):
        import rosbags.rosbag2
        import rosbags.typesys
    return rosbags


def image_topic(base: str) -> str:
    """The topic of an image; see ``FrameImage``."""
    return f"/{base}/image_raw/compressed"


def camera_topic(base: str) -> str:
    """The topic of a camera's intrinsics; see ``CameraView``."""
    return f"/{base}/camera_info"


class TopicMessages:
    """Makes the messages of frames.

    Args:
        frame_id: the coordinate frame of the markers, and the first part of all topics but the diagnostics'.

    Attributes:
        store: the message types, a ``Typestore``.
    """

    def __init__(self, frame_id: str) -> None:
        stores = require_rosbags().typesys
        self.store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
        self._messages, self._frame_id = Messages(self.store.types), frame_id

    @property
    def points_topic(self) -> str:
        """The topic of the markers."""
        return f"/{self._frame_id}/markers"

    def kinds(self, places: Iterable[ImagePlace] = (), has_contact: bool = False) -> dict[str, str]:
        """The types of all topics: of the markers, the diagnostics, of images at the places, and of a contact."""
        kinds = {self.points_topic: POINTS, DIAGNOSTICS_TOPIC: DIAGNOSTICS}
        if has_contact:
            kinds |= {f"/{self._frame_id}/wrench": WRENCH, f"/{self._frame_id}/regions": POINTS}
        for place in places:
            kinds[image_topic(place.base)] = IMAGE
            kinds |= {camera_topic(view.base): CAMERA for view in place.views}
        return kinds

    def of(self, frame: RecordedFrame) -> Iterator[TopicMessage]:
        """The messages of a frame: markers, diagnostics, contact, images, and the cameras of each image."""
        make, stamp = self._messages, Stamp(frame.ns, self._frame_id)
        yield self._message(self.points_topic, POINTS, make.points(stamp, frame.markers), frame.ns)
        report = make.diagnostics(stamp, frame.level, frame.text, frame.values)
        yield self._message(DIAGNOSTICS_TOPIC, DIAGNOSTICS, report, frame.ns)
        if frame.contact is not None:
            wrench = make.wrench(stamp, frame.contact.wrench)
            yield self._message(f"/{self._frame_id}/wrench", WRENCH, wrench, frame.ns)
            regions = make.points(stamp, frame.contact.regions)
            yield self._message(f"/{self._frame_id}/regions", POINTS, regions, frame.ns)
        for image in frame.images:
            stamp = Stamp(frame.ns, image.frame_id)
            picture = make.image(stamp, image.png)
            yield self._message(image_topic(image.base), IMAGE, picture, frame.ns)
            for view in image.views:
                camera = make.camera(stamp, image.size_px, view.lens)
                yield self._message(camera_topic(view.base), CAMERA, camera, frame.ns)

    def _message(self, topic: str, kind: str, message: Any, ns: int) -> TopicMessage:
        return TopicMessage(topic, kind, ns, self.store.serialize_cdr(message, kind))
