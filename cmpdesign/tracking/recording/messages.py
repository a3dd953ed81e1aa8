"""The messages of one frame: points, diagnostics, images and cameras."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

POINTS = "sensor_msgs/msg/PointCloud2"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA = "sensor_msgs/msg/CameraInfo"
WRENCH = "geometry_msgs/msg/WrenchStamped"
OK, WARN, ERROR = 0, 1, 2  # levels of a DiagnosticStatus
# Codes of a PointField's datatype.
_DATATYPES = {"uint8": 2, "uint32": 6, "float32": 7}


# ROS' names of the lenses, by the number of their coefficients.
DISTORTION_MODELS = {4: "equidistant", 5: "plumb_bob", 8: "rational_polynomial", 12: "rational_polynomial"}


class Stamp(NamedTuple):
    """A message's time in ns, and the coordinate frame of its content."""

    ns: int
    frame_id: str


class Lens(NamedTuple):
    """The intrinsics of a view; see ``View``. A focal length of 0 stands for unknown intrinsics, as in ROS."""

    focal_px: Sequence[float] = (0.0, 0.0)
    centre_px: Sequence[float] = (0.0, 0.0)
    distortion: Sequence[float] = ()
    area_px: Sequence[int] = (0, 0, 0, 0)


def _as_array(data: bytes) -> Any:
    return np.frombuffer(data, np.uint8)


class Messages:
    """Makes messages.

    Args:
        types: the classes of the message types by their names, as of a ``Typestore``, or ROS's own.
        octets: makes the value of a field of bytes; by default an array, for rosbags.
    """

    def __init__(self, types: Mapping[str, Any], octets: Callable[[bytes], Any] = _as_array) -> None:
        self._types, self._octets = types, octets

    def points(self, stamp: Stamp, records: NDArray[np.void]) -> Any:
        """A PointCloud2 of (M,) records; its data are the records' bytes."""
        size = records.dtype.itemsize
        return self._types[POINTS](
            header=self._header(stamp),
            height=1,
            width=len(records),
            fields=self._point_fields(records.dtype),
            is_bigendian=False,
            point_step=size,
            row_step=size * len(records),
            data=self._octets(records.tobytes()),
            is_dense=False,
        )

    def _point_fields(self, kind: np.dtype[Any]) -> list[Any]:
        fields = []
        for name in kind.names or ():
            base, shape = (one := kind[name]).base, one.shape
            fields.append(
                self._types["sensor_msgs/msg/PointField"](
                    name=name,
                    offset=kind.fields[name][1],  # type: ignore[index]
                    datatype=_DATATYPES[base.name],
                    count=shape[0] if shape else 1,
                )
            )
        return fields

    def diagnostics(self, stamp: Stamp, level: int, text: str, values: Mapping[str, str]) -> Any:
        """A DiagnosticArray of one status."""
        pairs = [
            self._types["diagnostic_msgs/msg/KeyValue"](key=key, value=value) for key, value in values.items()
        ]
        status = self._types["diagnostic_msgs/msg/DiagnosticStatus"](
            level=level,
            name=f"{stamp.frame_id}: markers",
            message=text,
            hardware_id=stamp.frame_id,
            values=pairs,
        )
        return self._types[DIAGNOSTICS](header=self._header(stamp), status=[status])

    def wrench(self, stamp: Stamp, wrench: NDArray[np.float64]) -> Any:
        """A WrenchStamped of force x, y, z in N and torque x, y, z in N m about the origin of the frame."""
        vector = self._types["geometry_msgs/msg/Vector3"]
        force, torque = (
            vector(**dict(zip("xyz", part.tolist(), strict=True))) for part in (wrench[:3], wrench[3:])
        )
        both = self._types["geometry_msgs/msg/Wrench"](force=force, torque=torque)
        return self._types[WRENCH](header=self._header(stamp), wrench=both)

    def image(self, stamp: Stamp, png: bytes) -> Any:
        """A CompressedImage of a PNG file's bytes."""
        return self._types[IMAGE](header=self._header(stamp), format="png", data=self._octets(png))

    def camera(self, stamp: Stamp, size_px: tuple[int, int], lens: Lens) -> Any:
        """A CameraInfo of an image (width, height); (cx, cy) is in the frame of the full image."""
        (fx, fy), (cx, cy) = lens.focal_px, lens.centre_px
        k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1 if fx else 0]], np.float64)
        x, y, width, height = map(int, lens.area_px)
        return self._types[CAMERA](
            header=self._header(stamp),
            height=size_px[1],
            width=size_px[0],
            distortion_model=DISTORTION_MODELS[len(lens.distortion)] if fx else "",
            d=np.array(lens.distortion, np.float64),
            k=k.ravel(),
            r=(np.eye(3) if fx else np.zeros((3, 3))).ravel(),
            p=np.pad(k, ((0, 0), (0, 1))).ravel(),
            binning_x=0,
            binning_y=0,
            roi=self._types["sensor_msgs/msg/RegionOfInterest"](
                x_offset=x, y_offset=y, height=height, width=width, do_rectify=False
            ),
        )

    def _header(self, stamp: Stamp) -> Any:
        seconds, nanoseconds = divmod(stamp.ns, 10**9)
        time = self._types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        return self._types["std_msgs/msg/Header"](stamp=time, frame_id=stamp.frame_id)
