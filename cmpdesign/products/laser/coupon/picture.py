"""A coupon's picture as light: values decoded, sampled at places of the coupon, and checked for clipping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import Image

Values = NDArray[np.float64]
LightImage = NDArray[np.float32]
PointMap = Callable[[Values], Values]
# Values this close to the largest one are clipped: JPEG moves clipped values by one step.
CLIPPED_STEPS = 1.5
# Largest share of pixels at the bright and at the dark end. In light, a dark end that a part of the noise reaches
# is off by less than 0.001.
MAX_CLIPPED_BRIGHT, MAX_CLIPPED_DARK = 0.02, 0.5
CLIP_REMEDY = (
    "expose less, and scan without automatic levels or contrast, so that neither sheet nor ground is all white or "
    "black"
)


class PhotoError(CmpDesignError, ValueError):
    """A picture in which the coupon cannot be measured."""


@dataclass(frozen=True, eq=False)
class CouponPicture:
    """The light of a picture, and the map of the coupon.

    Attributes:
        light: (H, W) float32, 0 to 255.
        to_image: (N, 2) coupon (mm) -> (N, 2) image (px).
        scale: px per mm.
    """

    light: LightImage
    to_image: PointMap
    scale: float

    def sample(self, points_mm: Values) -> Values:
        """The light at (..., 2) points of the coupon, by bilinear interpolation.

        Raises:
            PhotoError: a point lies outside the picture.
        """
        import cv2

        xy = image_points(self.to_image, points_mm, self.light.shape)
        sampled = cv2.remap(
            self.light, xy[..., 0], xy[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(sampled, dtype=np.float64)


def decode_image(image: Image, light_of_value: Values, exponent: float = 1.0) -> LightImage:
    """(H, W) float32, 0 to 255: the mean light of the channels, raised to an exponent.

    Args:
        image: (H, W, 3) uint8 or uint16.
        light_of_value: (256,) the light of each 8-bit value, 0 to 255.
        exponent: of the light, in units of the largest one.
    """
    count = 256 if image.dtype == np.uint8 else 65536
    values = np.arange(count) * (255.0 / (count - 1))
    light = np.interp(values, np.arange(256.0), light_of_value)
    table = (255.0 * (light / 255.0) ** exponent).astype(np.float32)
    channels = [np.take(table, image[..., channel], mode="clip") for channel in range(3)]
    channels[0] += channels[1]
    channels[0] += channels[2]
    channels[0] /= 3
    return channels[0]


def eight_bit_gray(image: Image) -> NDArray[np.uint8]:
    """(H, W) the mean of the channels, in steps of 8 bits."""
    gray = image.mean(axis=2) / (257.0 if image.dtype == np.uint16 else 1.0)
    return np.asarray(np.rint(gray), dtype=np.uint8)


def require_unclipped(image: Image, to_image: PointMap, points_mm: Values, what: str) -> None:
    """Refuse a picture in which pixels at (N, 2) points of the coupon lie at an end of the values.

    Raises:
        PhotoError: too many are clipped, in any channel; ``what`` names the place.
    """
    xy = np.rint(image_points(to_image, points_mm, image.shape)).astype(int)
    height, width = image.shape[:2]
    values = image[np.clip(xy[:, 1], 0, height - 1), np.clip(xy[:, 0], 0, width - 1)].astype(np.float64)
    values /= 257.0 if image.dtype == np.uint16 else 1.0
    ends = (
        ("white", (values > 255 - CLIPPED_STEPS).mean(axis=0).max(), MAX_CLIPPED_BRIGHT),
        ("black", (values < CLIPPED_STEPS - 1).mean(axis=0).max(), MAX_CLIPPED_DARK),
    )
    for name, share, limit in ends:
        if share > limit:
            raise PhotoError(
                f"{what} is clipped to {name} in {100 * share:.0f} % of its pixels, limit {100 * limit:g} %; "
                f"{CLIP_REMEDY}"
            )


def image_points(to_image: PointMap, points_mm: Values, shape: tuple[int, ...]) -> LightImage:
    """(..., 2) float32: places in the image of (..., 2) points of the coupon.

    Raises:
        PhotoError: a point lies outside the picture.
    """
    xy = to_image(points_mm.reshape(-1, 2)).reshape(points_mm.shape).astype(np.float32)
    height, width = shape[:2]
    if not ((xy >= 0).all() and (xy[..., 0] < width).all() and (xy[..., 1] < height).all()):
        raise PhotoError("a part of the coupon lies outside the picture; show the whole coupon")
    return xy
