"""Hue and chroma of an image, and the hues of its inks under the light of the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native


class HueLimits(NamedTuple):
    """Limits of the search for the inks' hues.

    Attributes:
        reach_deg: degrees, the maximum shift of an ink's hue from its nominal hue; 60 would be ambiguous. Chosen below
            that.
        width_deg: degrees; pixels farther from every center do not count. Chosen.
        rounds: of the 3-means. Chosen.
        min_chroma: gray levels; below it, 8-bit hue is noise. Chosen.
        ink_width_deg: degrees; hues as far from every ink belong to none. It is half of the distance of the nominal
            hues. Derived.
    """

    reach_deg: float = 50.0
    width_deg: float = 40.0
    rounds: int = 8
    min_chroma: int = 12
    ink_width_deg: float = 60.0


LIMITS = HueLimits()


@dataclass(frozen=True, eq=False)
class Colors:
    """The colors of an image.

    Attributes:
        hsv: (H, W, 3) uint8, OpenCV's scale: H 0..179 (2 degrees per step), S and V 0..255.
        hue: (H, W) uint8, the channel H.
        chroma: (H, W) uint8, max - min of B, G, R: 0 for black, gray and white in white light.
    """

    hsv: NDArray[np.uint8]
    hue: NDArray[np.uint8]
    chroma: NDArray[np.uint8]


def nominal_hues_deg(palette: dict[str, str]) -> NDArray[np.float64]:
    """(3,) float64 hues in degrees of the palette's red, green and blue ("#rrggbb")."""
    inks = [[int(palette[c][i : i + 2], 16) for i in (5, 3, 1)] for c in ("red", "green", "blue")]
    hsv = cv2.cvtColor(np.array([inks], np.float32) / 255, cv2.COLOR_BGR2HSV)
    return hsv[0, :, 0].astype(np.float64)


def to_colors(image: NDArray[np.uint8]) -> Colors:
    """HSV and chroma of a BGR image (H, W, 3) uint8."""
    return Colors(*native.hsv_and_chroma(np.ascontiguousarray(image)))


def hue_weights(hue: NDArray[np.uint8], chroma: NDArray[np.uint8]) -> NDArray[np.float64]:
    """(180,) float64, the sum of the chroma of all colored pixels of each hue; hue, chroma (H, W)."""
    return np.asarray(native.hue_weights(hue, chroma, LIMITS))


def find_hues(weight: NDArray[np.float64], nominal_deg: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """(3,) float64, the hues of the inks in the image, degrees; None where an ink has no pixels.

    The method is circular 3-means, started from the nominal hues (3,), on the weights (180,) of hues in steps of
    2 degrees. White balance and colored light shift hues; shifts end at ``reach_deg``, so that no ink is taken for
    another.
    """
    hues_deg, found = native.find_hues(weight, nominal_deg, LIMITS)
    return hues_deg if found else None
