"""Learning of the markers' places on one pad, from pictures of this pad at rest.

A made pad differs from its design. Its markers are scattered, and the reader's prior, that the map from layout to
image is smooth, is then wrong for pictures of the pad that are read with the nominal layout. The displacement
from the places of the markers as made is smooth. ``learn_layout`` measures these places. The first reading, with the
nominal layout, is biased towards the nominal places; so pictures are read again with the learnt places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extractor.errors import ImageError, RestError
from extractor.layout.layout_file import LayoutLike, layout_of
from extractor.layout.reference import AsMade, Reference
from extractor.made.adjustment import Adjustment, Readings, adjust_places
from extractor.pipeline import Extractor
from extractor.result import Markers, Status

PRODUCT = "measured"
MIN_PICTURES = 10
MIN_SHARE = 0.5  # of the visible markers, measured in every picture; chosen
MAX_PICTURE_Z = 2.0
# After three readings the places are biased towards the nominal places by up to 0.5 deviations more (40 pictures, or a
# scatter of 0.5 px); a fifth reading has no effect.
READINGS = 4
DECIMALS = 6  # of a place in mm; a nanometre is below the accuracy of any reading
COVARIANCE_DIGITS = 6


@dataclass(frozen=True, eq=False)
class LearntLayout:
    """The layout of one pad as made.

    Attributes:
        layout: the nominal layout with the places of this pad's markers, and their covariances (``as_made``). A
            marker that no picture shows stays at its nominal place.
        measured: (M,) bool, the markers that were measured.
        scatter_mm: root mean square distance per axis of the measured places from the nominal places, less the part
            that the covariances explain.
        z: residuals of all readings over their stated deviations. The covariances of the places are multiplied by z
            squared.
        picture_z, picture_rms_px: (V,) the same of every picture, and root mean square residual per axis.
        picture_share: (V,) share of the visible markers that a picture measured.
    """

    layout: Reference
    measured: NDArray[np.bool_]
    scatter_mm: float
    z: float
    picture_z: NDArray[np.float64]
    picture_rms_px: NDArray[np.float64]
    picture_share: NDArray[np.float64]


def learn_layout(
    layout: LayoutLike,
    images: Sequence[NDArray[Any]],
    *,
    names: Sequence[str] | None = None,
    watch: Callable[[int, int], None] = lambda done, total: None,
    **options: Any,
) -> LearntLayout:
    """The places of a pad's markers from pictures of the pad at rest, from any direction, each picture by one
    homography.

    The pictures determine the places up to a homography of the whole pad: its position, turn, size, shear and
    perspective are those that fit the nominal places best. A deformation of all pictures, as by the lens of a camera
    that cannot move over its pad, enters the places; this has no effect on displacements from these places.

    Args:
        layout: the nominal layout of a triangular pattern, as for ``Extractor``.
        images: 10 pictures or more, as for ``Extractor.extract``.
        names: names of the pictures, for messages; by default "picture 1" and so on.
        watch: called after every reading of a picture with the number of finished readings and of all readings; every
            picture is read ``READINGS`` times.
        options: options of ``Extractor``, such as ``response``. The preset is "accurate" unless another is given: an
            error of a preset that is common to all pictures does not fall with their number.

    Raises:
        RestError: too few pictures, a picture that is not read, pictures of both sides, or a picture that differs
            from the others by more than a homography.
        LayoutError: the layout is as made already, is not triangular, or the learnt cells overlap.
        ImageError: an image of another type or shape.
    """
    layout = layout_of(layout)
    if layout.as_made is not None:
        raise RestError(f"the layout is of a pad as made ({layout.as_made.product}); give the nominal layout")
    if len(images) < MIN_PICTURES:
        raise RestError(f"{len(images)} pictures of the pad at rest; give {MIN_PICTURES} or more")
    names = names or [f"picture {number}" for number in range(1, len(images) + 1)]
    current = layout
    for reading in range(READINGS):
        extractor = Extractor(current, **{"preset": "accurate", **options})
        read: list[Markers] = []
        for image, name in zip(images, names, strict=True):
            read.append(_read(extractor, image, name))
            watch(reading * len(images) + len(read), READINGS * len(images))
        side = _common_side(read, names)
        found = _adjusted(read, names, layout)
        current = _as_made(layout, found, side)
    worst = int(found.picture_z.argmax())
    if found.picture_z[worst] > MAX_PICTURE_Z:
        raise RestError(
            f"{names[worst]}: the markers lie {found.picture_rms_px[worst]:.3f} px per axis from a homography of the "
            f"other pictures' ({found.picture_z[worst]:.1f} stated deviations, limit {MAX_PICTURE_Z:g}); leave it out "
            "if the "
            "pad was pressed or moved, and do not move a camera with lens distortion over the pad"
        )
    return _learnt(layout, current, found, read)


def _read(extractor: Extractor, image: NDArray[Any], name: str) -> Markers:
    """The markers of one picture.

    Raises:
        RestError: too few markers are measured.
    """
    try:
        markers = extractor.extract(image)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from None
    share = _measured_share(extractor.layout, markers)
    if share < MIN_SHARE:
        why = f", {markers.reason}" if markers.reason else ""
        raise RestError(
            f"{name}: {share:.0%} of the markers measured{why}; at least {MIN_SHARE:.0%} must be: leave the picture "
            "out, or check the layout, light, focus and objects on the pad"
        )
    return markers


def _measured_share(layout: Reference, markers: Markers) -> float:
    return float((markers.status[layout.present] == Status.MEASURED).mean())


def _common_side(read: Sequence[Markers], names: Sequence[str]) -> str:
    """The side that all pictures show.

    Raises:
        RestError: the pictures show both sides.
    """
    sides = ["back" if markers.mirrored else "front" for markers in read]
    for side, name in zip(sides, names, strict=True):
        if side != sides[0]:
            raise RestError(
                f"{name} shows the {side} of the pad, {names[0]} the {sides[0]}; give pictures of one side"
            )
    return sides[0]


def _adjusted(read: Sequence[Markers], names: Sequence[str], layout: Reference) -> Adjustment:
    measured = np.stack([markers.status == Status.MEASURED for markers in read])
    readings = Readings(
        np.where(measured[..., None], np.stack([markers.xy_px for markers in read]), np.nan),
        np.stack([markers.cov_px2 for markers in read]),
    )
    return adjust_places(readings, layout.xy_mm)


def _as_made(layout: Reference, found: Adjustment, side: str) -> Reference:
    """The layout with the found places.

    Raises:
        LayoutError: its cells overlap.
    """
    xy_mm = np.where(np.isfinite(found.xy_mm), np.round(found.xy_mm, DECIMALS), layout.xy_mm) + 0.0
    made = AsMade(layout.digest, PRODUCT, side, covariance_mm2=_rounded(found.cov_mm2))
    reference = replace(layout, xy_mm=xy_mm, as_made=made)
    return replace(reference, digest=reference.geometry_digest())


def _rounded(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariances rounded so that every run on a machine writes the same digits."""
    values = [float(f"{value:.{COVARIANCE_DIGITS - 1}e}") for value in covariance.ravel().tolist()]
    return np.array(values).reshape(covariance.shape)


def _learnt(layout: Reference, made: Reference, found: Adjustment, read: Sequence[Markers]) -> LearntLayout:
    measured = np.isfinite(found.xy_mm[:, 0])
    moved = (found.xy_mm - layout.xy_mm)[measured]
    explained = float(np.trace(found.cov_mm2[measured].mean(axis=0)) / 2)
    return LearntLayout(
        layout=made,
        measured=measured,
        scatter_mm=float(np.sqrt(max(float((moved**2).mean()) - explained, 0.0))),
        z=found.z,
        picture_z=found.picture_z,
        picture_rms_px=found.picture_rms_px,
        picture_share=np.array([_measured_share(layout, markers) for markers in read]),
    )
