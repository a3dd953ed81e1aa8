"""The messages of a recording, decoded by readers of ROS 2 messages that are not ours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import DecodedMessageTuple, make_reader
from mcap_ros2.decoder import DecoderFactory

NUMPY_TYPES = {2: "u1", 6: "<u4", 7: "<f4"}  # of the datatypes of a PointField
Messages = dict[str, list[DecodedMessageTuple]]


def read_messages(path: Path) -> Messages:
    """The messages of each topic, with their times."""
    found: Messages = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for one in reader.iter_decoded_messages():
            found.setdefault(one.channel.topic, []).append(one)
            stamp = one.decoded_message.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == one.message.log_time == one.message.publish_time
    return found


def points_of(message: Any) -> np.ndarray:
    """The points, decoded by the message's description of its bytes."""
    cloud = message.decoded_message
    kind = {
        "names": [field.name for field in cloud.fields],
        "formats": [(NUMPY_TYPES[field.datatype], (field.count,)) for field in cloud.fields],
        "offsets": [field.offset for field in cloud.fields],
        "itemsize": cloud.point_step,
    }
    assert cloud.height == 1 and not cloud.is_bigendian and not cloud.is_dense
    assert cloud.row_step == cloud.width * cloud.point_step == len(cloud.data)
    return np.frombuffer(bytes(cloud.data), np.dtype(kind))
