"""The kerf from a photo or scan of a coupon.

The fiducials give the map from the coupon to the picture. Widths are sums of light, so values become light first, by
the response that the user or the file states, else by sRGB; the edges of the openings then show whether the response is
right (``response_fit``). The visible width of a cut through the sheet is that of the narrower face; the taper gives the
other face.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cmpdesign.errors import parameter
from cmpdesign.files.images import Image
from cmpdesign.products.laser.coupon.design import Coupon, Face, Patch
from cmpdesign.products.laser.coupon.edges import read_edges
from cmpdesign.products.laser.coupon.fiducials import FiducialFit, find_fiducials, fit_fiducials
from cmpdesign.products.laser.coupon.kerf_fit import fit_kerfs, scale_deviation
from cmpdesign.products.laser.coupon.openings import (
    measured_directions,
    read_profiles,
    sheet_and_opening_points,
)
from cmpdesign.products.laser.coupon.picture import (
    CouponPicture,
    PhotoError,
    Values,
    decode_image,
    eight_bit_gray,
    require_unclipped,
)
from cmpdesign.products.laser.coupon.response_fit import (
    KerfsInLight,
    fit_response,
    hold_response,
)
from extractor.image.response import Response, light_of_values

SMALLEST_SCALE_PX_MM = 6.0


@dataclass(frozen=True)
class MeasuredWidth:
    """A width in mm with its standard deviation."""

    value_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class PatchKerf:
    """The kerf of one patch at the face that was seen: ``x`` of cuts along y, ``y`` of cuts along x."""

    patch: Patch
    x: MeasuredWidth
    y: MeasuredWidth


@dataclass(frozen=True)
class CouponReading:
    """The measures of a coupon's picture.

    Attributes:
        patches: the kerf of each patch at the face that was seen.
        face: the face that was seen.
        narrowing_mm: width of cuts at the front less the width at the back, by the stated taper.
        scale_px_mm: pixels per millimetre.
        fit_mm: RMS distance of the fiducials from their places by the fitted map.
        from_back: the picture is taken from the coupon's back.
        response: conversion of values to light, in a few words.
    """

    patches: tuple[PatchKerf, ...]
    face: Face
    narrowing_mm: float
    scale_px_mm: float
    fit_mm: float
    from_back: bool
    response: str

    def at_face(self, face: Face, seen: MeasuredWidth) -> MeasuredWidth:
        """A kerf that was seen, at a face of the sheet."""
        widening = (
            0.0 if face == self.face else (self.narrowing_mm if face == "front" else -self.narrowing_mm)
        )
        return MeasuredWidth(seen.value_mm + widening, seen.sigma_mm)

    def to_json(self, coupon: Coupon) -> dict[str, Any]:
        """The reading of a coupon as in the document of ``kerf``."""
        return {
            "format": "cmp-kerf",
            "version": 2,
            "from_back": self.from_back,
            "face": self.face,
            "taper_deg": coupon.taper_deg,
            "taper_assumed": coupon.taper_assumed,
            "thickness_mm": coupon.thickness_mm,
            "response": self.response,
            "scale_px_mm": round(self.scale_px_mm, 4),
            "fit_mm": round(self.fit_mm, 6),
            "patches": [
                {
                    "name": one.patch.name,
                    "power_percent": one.patch.power_percent,
                    "speed_mm_s": one.patch.speed_mm_s,
                    "passes": one.patch.passes,
                    **self._axis_to_json("x", one.x),
                    **self._axis_to_json("y", one.y),
                }
                for one in self.patches
            ],
        }

    def _axis_to_json(self, axis: str, seen: MeasuredWidth) -> dict[str, float]:
        """Kerfs at the front (as in a material's file) and at the back, and their deviation."""
        return {
            f"kerf_{axis}_mm": round(self.at_face("front", seen).value_mm, 5),
            f"kerf_{axis}_back_mm": round(self.at_face("back", seen).value_mm, 5),
            f"kerf_{axis}_sigma_mm": round(seen.sigma_mm, 5),
        }


def read_coupon(
    coupon: Coupon,
    image: Image,
    *,
    response: Response | None = None,
    stated: Response | None = None,
    face: Face | None = None,
) -> CouponReading:
    """Measure the kerf of every patch.

    Args:
        coupon: the coupon that was cut.
        image: (H, W, 3) uint8 or uint16 BGR; openings are darker or brighter than the sheet.
        response: relation of light and values, stated by the user; None: ``stated``, else sRGB (16 bits: or linear), as
            far as the picture's edges agree, or the exponent that makes them symmetric.
        stated: the response that the file states.
        face: the face whose openings are seen; None: the face with the narrower openings, by the coupon's taper.

    Raises:
        PhotoError: the coupon is not found, too small, clipped, or has too little contrast; its edges contradict the
            response; the taper would close the cuts.
        ValueError: no response.
    """
    approximate = find_fiducials(eight_bit_gray(image), coupon)
    reader = _CouponReader(coupon, image, approximate)
    start: Response = response if response is not None else "srgb"
    first = reader.fit(start)
    _check_picture(coupon, image, first)
    edges = read_edges(coupon, image, first, float(reader.kerfs(start).value_mm.mean()))
    if response is not None:
        fitted = hold_response(reader.kerfs, edges, response)
    else:
        usual: list[Response] = ["srgb"] if image.dtype == np.uint8 else ["srgb", "linear"]
        fitted = fit_response(reader.kerfs, edges, [stated] if stated is not None else usual)
    patches = tuple(
        PatchKerf(patch, *(MeasuredWidth(float(v), float(s)) for v, s in zip(values, sigmas, strict=True)))
        for patch, values, sigmas in zip(
            coupon.patches, fitted.kerfs.value_mm.T, fitted.kerfs.sigma_mm.T, strict=True
        )
    )
    reading = CouponReading(
        patches=patches,
        face=face or coupon.narrow_face,
        narrowing_mm=coupon.narrowing_mm,
        scale_px_mm=first.scale,
        fit_mm=first.rms_mm,
        from_back=first.from_back,
        response=fitted.description,
    )
    _require_open_cuts(coupon, reading)
    return reading


class _CouponReader:
    """Kerfs of one picture by any response."""

    def __init__(self, coupon: Coupon, image: Image, approximate: Values) -> None:
        self._coupon, self._image, self._approximate = coupon, image, approximate

    def fit(self, response: Response) -> FiducialFit:
        light = decode_image(self._image, light_of_values(response))
        return fit_fiducials(self._approximate, self._coupon, light)

    def kerfs(self, response: Response) -> KerfsInLight:
        light = decode_image(self._image, light_of_values(response))
        fit = fit_fiducials(self._approximate, self._coupon, light)
        profiles = read_profiles(self._coupon, CouponPicture(light, fit.to_image, fit.scale))
        deviation = scale_deviation(self._coupon, fit.rms_mm)
        fits = [fit_kerfs(profiles, along_x, deviation) for along_x in (True, False)]
        return KerfsInLight(
            np.stack([one.value_mm for one in fits]), np.stack([one.sigma_mm for one in fits])
        )


def _check_picture(coupon: Coupon, image: Image, fit: FiducialFit) -> None:
    if fit.scale < SMALLEST_SCALE_PX_MM:
        raise PhotoError(
            f"the photo has {fit.scale:.1f} px in a mm, limit {SMALLEST_SCALE_PX_MM:g} px; go nearer, "
            "or scan at 300 dpi"
        )
    for across in measured_directions(coupon):
        sheet, inside = sheet_and_opening_points(across)
        place = f"at ({across.opening.x_mm:g}, {across.opening.y_mm:g}) mm"
        require_unclipped(image, fit.to_image, sheet, f"the sheet {place}")
        if len(inside):
            require_unclipped(image, fit.to_image, inside, f"the opening {place}")


def _require_open_cuts(coupon: Coupon, reading: CouponReading) -> None:
    for one in reading.patches:
        for seen in (one.x, one.y):
            narrow = reading.at_face(coupon.narrow_face, seen).value_mm
            if narrow <= 0:
                raise PhotoError(
                    f"patch {one.patch.name}: {seen.value_mm:.3f} mm at the {reading.face} would be {narrow:.3f} mm "
                    f"at the {coupon.narrow_face} by the taper of {coupon.taper_deg:g} degrees through "
                    f"{coupon.thickness_mm:g} mm, limit 0 mm; leave {parameter('face')} out where the ground "
                    "shows through the cuts, or correct laser.taper_deg and build the coupon.json again"
                )
