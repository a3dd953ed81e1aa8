"""Models of a camera: the number of its parameters, their names, and how far they can be from usual values."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor import View
from extractor.space.lens import NAMES, LensKind

Array = NDArray[np.float64]

# Standard deviations of usual cameras around no distortion; wide, so that only what nothing else determines is held.
SPREADS = {"k": 3.0, "p": 0.1, "s": 0.1}
FISHEYE_SPREAD = 1.0
FOCAL_SPREAD = 1.0  # of the focal length, relative to the first estimate
CENTRE_SPREAD = 0.2  # of the principal point around the image's middle, of the image's size


class CameraModel(NamedTuple):
    """A model of the camera.

    Attributes:
        name: for users.
        kind: the lens.
        coefficients: their number.
    """

    name: str
    kind: LensKind
    coefficients: int

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in the order of parameter vectors."""
        return ("fx_px", "fy_px", "cx_px", "cy_px", *NAMES[self.kind][: self.coefficients])

    def view(self, values: Array, name: str = "camera") -> View:
        """The camera with these values (4 + K,), without a pose."""
        fx, fy, cx, cy, *lens = map(float, values)
        return View(name, (fx, fy), (cx, cy), tuple(lens), lens=self.kind)

    def spreads(self, focal_px: float, size_px: tuple[int, int]) -> Array:
        """(4 + K,) standard deviations of the parameters of usual cameras."""
        first = [focal_px * FOCAL_SPREAD] * 2 + [CENTRE_SPREAD * side for side in size_px]
        fisheye = self.kind == "fisheye"
        return np.array([*first, *(FISHEYE_SPREAD if fisheye else SPREADS[n[0]] for n in self.names[4:])])


# From the fewest parameters.
MODELS = (
    CameraModel("fisheye", "fisheye", 4),
    CameraModel("5 coefficients", "perspective", 5),
    CameraModel("8 coefficients", "perspective", 8),
    CameraModel("12 coefficients", "perspective", 12),
)


def parameters(view: View) -> Array:
    """(4 + K,) the parameters of a camera."""
    return np.array([*view.focal_px, *view.centre_px, *view.distortion])
