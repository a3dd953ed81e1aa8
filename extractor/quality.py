"""The quality of an image for reading: the properties that can be adjusted at a camera."""

from __future__ import annotations

from dataclasses import dataclass

from extractor.frozen_record import FrozenRecord

# Beyond these limits a property reduces the number of markers or their precision. The limits give hints only.
MIN_EDGE_PX = 8.0
MAX_BLUR_SHARE = 0.2  # of an edge
MAX_NOISE = 15.0  # gray levels of 255
MIN_CONTRAST = 20.0  # CIE76
MAX_CLIPPING = 0.1
MIN_EVENNESS = 0.2


@dataclass(frozen=True)
class Quality(FrozenRecord):
    """The properties of one image by which its markers can be read, and a hint for each that limits them.

    A property that could not be measured is NaN. Where no marker was found, clipping and noise are those of the whole
    image, and contrast, evenness and edge are those of the found cells without numbers; the edge is NaN if these cells
    are no pattern.

    Attributes:
        blur_px: sigma of the blur, pixel included, px.
        noise: standard deviation of one channel's noise, gray levels of 255.
        contrast: CIE76 color difference of the two inks that differ least; black is an ink, too.
        weakest_inks: the names of these two inks; empty strings where the contrast is NaN.
        clipping: share of the colored cells with a channel at its largest value.
        evenness: light of the cells in the dimmest twentieth over that in the brightest, each cell relative to its
            ink. 1: even.
        edge_px: median distance of neighbouring markers, px.
        row_fault: "torn" or "rolling shutter" where the image is broken along a row; else "".
        row_jump_px: how far the image jumps there, px; 0 without a break.
    """

    blur_px: float
    noise: float
    contrast: float
    weakest_inks: tuple[str, str]
    clipping: float
    evenness: float
    edge_px: float
    row_fault: str = ""
    row_jump_px: float = 0.0

    @property
    def hints(self) -> tuple[str, ...]:
        """One sentence for each property that limits the result: value, limit, and remedy."""
        return tuple(text for limits, text in self._judged() if limits)

    def _judged(self) -> tuple[tuple[bool, str], ...]:
        """For each property whether it limits the result, and the hint; comparisons with NaN are False."""
        one, other = self.weakest_inks
        return (
            (
                self.edge_px < MIN_EDGE_PX,
                f"the pattern is small: {self.edge_px:.1f} px an edge, at least {MIN_EDGE_PX:g} px are needed; "
                "move the camera nearer, or use more pixels",
            ),
            (
                self.blur_px > MAX_BLUR_SHARE * self.edge_px,
                f"the image is blurred: {self.blur_px:.1f} px, at most {MAX_BLUR_SHARE:g} of an edge of "
                f"{self.edge_px:.1f} px is good; focus, and shorten the exposure where the pattern moves",
            ),
            (
                self.noise > MAX_NOISE,
                f"the image is noisy: {self.noise:.0f} of 255, at most {MAX_NOISE:g} is good; "
                "use more light and less gain",
            ),
            (
                self.contrast < MIN_CONTRAST,
                f"{one} and {other} look alike: they differ by {self.contrast:.0f} (CIE76), at least "
                f"{MIN_CONTRAST:g} is good; use more light, white light, or stronger inks",
            ),
            (
                self.clipping > MAX_CLIPPING,
                f"the image is overexposed: {self.clipping:.0%} of the cells are clipped, at most "
                f"{MAX_CLIPPING:.0%} is good; shorten the exposure, or use less light",
            ),
            (
                self.evenness < MIN_EVENNESS,
                f"the light is uneven: the dimmest cells have {self.evenness:.0%} of the light of the brightest, at "
                f"least {MIN_EVENNESS:.0%} is good; spread the light, or light from several sides",
            ),
            (
                self.row_fault == "torn",
                f"the image is torn along a row: it jumps by {self.row_jump_px:.1f} px or more; read whole frames: "
                "fewer pixels or frames a second, or a shorter cable",
            ),
            (
                self.row_fault == "rolling shutter",
                f"the rows were taken at different times (rolling shutter): they jump by {self.row_jump_px:.1f} px; "
                "hold camera and pattern still, or use a global shutter",
            ),
        )


_NAN = float("nan")
UNKNOWN = Quality(_NAN, _NAN, _NAN, ("", ""), _NAN, _NAN, _NAN)
