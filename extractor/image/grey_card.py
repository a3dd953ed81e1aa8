"""The pattern as its own grey card: the light's color is taken from an image before hues are read.

Every neighbourhood of the pattern holds the same area of red, green and blue ink. So the means of the channels over
black would be about equal in white light; their ratios are the color of the light there. A surround of one color, of
wood or of skin holds no such inks: all channels vary alike in it, and it does not count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor._native import image as native

TILE_PX = 8  # side of the tiles whose channels are compared
SURVEY_PIXELS = 20_000  # in larger images, every other pixel of every other row counts


class GreyCardLimits(NamedTuple):
    """Limits of the grey card.

    Attributes:
        sigma_share: of the image's shorter side: the standard deviation of the Gaussian over which means are taken.
            Measured: rule "local grey card".
        half_weight_share: of the typical independent variation of the channels; a tile with it weighs one half. Chosen.
        rest_weight_share: of the weight of a whole neighbourhood: the weight of the whole pattern, which counts far
            away from it. Chosen.
        white_ratio: typical ratio of the strongest channel's mean to the weakest one's up to which the light counts as
            white: hues tell the inks apart then, and where inks are of different strength, gains would tint white.
            Measured: rule "grey card".
        ink_ratio: the part of that ratio that is left to inks of different strength when the light is colored. Chosen:
            less tints white where an ink is dark, more leaves hues too far from the palette's.
        min_level: gray levels, the least mean over black; below it, the mean is noise. Chosen.
        max_gain: the largest gain of a channel. Chosen: more would show noise alone.
    """

    sigma_share: float = 0.15
    half_weight_share: float = 0.2
    rest_weight_share: float = 0.02
    white_ratio: float = 1.45
    ink_ratio: float = 1.28
    min_level: float = 1.5
    max_gain: float = 12.0


LIMITS = GreyCardLimits()


@dataclass(frozen=True, eq=False)
class GreyCard:
    """The color of the light, as fields over tiles of an image.

    Attributes:
        gain, offset: (3, h, w) float32, channels B, G, R: in white light, a value v would be gain * v + offset.
            1 and 0 where the light counts as white.
        tile_px: side of a tile in px of the full image.
        ratio: of the strongest channel's mean over black, in the whole pattern, to the weakest one's; 1 without a
            pattern.
    """

    gain: NDArray[np.float32]
    offset: NDArray[np.float32]
    tile_px: int
    ratio: float

    @property
    def is_white(self) -> bool:
        """The light counts as white: images are left as they are."""
        return self.ratio <= LIMITS.white_ratio


def find_grey_card(image: NDArray[np.uint8], scale: int) -> GreyCard:
    """The color of the light of a BGR image (H, W, 3) uint8 at 1/``scale`` of the full size."""
    step = 2 if image.shape[0] * image.shape[1] > SURVEY_PIXELS else 1
    statistics = native.tile_statistics(image, TILE_PX, step)
    gain, offset, ratio = native.grey_card_fields(statistics, LIMITS)
    return GreyCard(gain, offset, TILE_PX * scale, ratio)


def remove_light_color(image: NDArray[np.uint8], card: GreyCard, scale: int) -> NDArray[np.uint8]:
    """A BGR image (H, W, 3) uint8 as in white light, for recognition; the image itself where its light is white.

    Each channel is stretched about its black by gains of at least 1, and black has no color then. Values beyond 255 are
    clipped.

    Args:
        card: the color of the light.
        scale: full-scale pixels per pixel of ``image``.
    """
    if card.is_white:
        return image
    return np.asarray(native.with_fields(image, card.gain, card.offset, card.tile_px / scale))
