"""Resolution of a design's sizes to layers, pitch and aspect."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cmpdesign.design.design import ASPECT_MAX, ASPECT_MIN, Design
from cmpdesign.errors import DesignError
from cmpdesign.layout.layout import DECIMALS
from cmpdesign.layout.outline import (
    Points,
    circle_outline,
    corner_offsets,
    drop_collinear_points,
    rectangle_outline,
    rotation_matrix,
)
from cmpdesign.patterns import PatternShape, registered_patterns
from cmpdesign.patterns.graphs import MAX_LAYERS

DEFAULT_ASPECT = 0.75
# With this rounding 200 layers still meet the requested size to a picometre, equally on every machine.
_SIZE_DECIMALS = 12


def resolve_size(design: Design) -> tuple[PatternShape, float]:
    """The pattern's shape and its pitch in mm.

    Raises:
        DesignError: no pattern fits the overall size, or the clip outline needs too many layers.
    """
    if design.layers is not None and design.pitch_mm is not None:
        return _make_shape(design, design.layers), design.pitch_mm
    if design.layers is not None:
        shape = _make_shape(design, design.layers)
        return shape, fitting_pitch_mm(design, shape)
    return _make_shape(design, _fitting_layers(design)), _require_given(design.pitch_mm)


def rim_corners(design: Design, shape: PatternShape) -> Points:
    """(K, 2): the rim's corners relative to the pattern's centre, for a pitch of one, rotated, counter-clockwise."""
    pattern = registered_patterns()[design.pattern]
    corners = drop_collinear_points(pattern.positions(*pattern.graph.rim(shape.layers), shape))
    return (corners - pattern_centre(design, shape)) @ rotation_matrix(design.rotation_deg).T


def pattern_centre(design: Design, shape: PatternShape) -> Points:
    """(2,): the pattern's centre for a pitch of one, unrotated; marker 0 is the origin."""
    pattern = registered_patterns()[design.pattern]
    return np.asarray(pattern.positions(*pattern.graph.centre(shape.layers), shape).mean(axis=0))


def fitting_pitch_mm(design: Design, shape: PatternShape) -> float:
    """The largest pitch in mm at which the pattern and its border fit the overall size.

    Raises:
        DesignError: the border alone exceeds the overall size.
    """
    corners = rim_corners(design, shape)
    border = design.border_mm * corner_offsets(corners)
    pitches = []
    for axis, limit_mm in enumerate((design.width_mm, design.height_mm)):
        if limit_mm is None:
            continue
        border_only_mm = float(np.ptp(border[:, axis]))
        if border_only_mm >= limit_mm:
            name = ("width_mm", "height_mm")[axis]
            raise DesignError(
                f"{name} = {limit_mm:g} mm leaves no area inside the border, which alone takes "
                f"{border_only_mm:.3g} mm; make it larger or border_mm smaller"
            )
        pitches.append(_largest_pitch(corners[:, axis], border[:, axis], limit_mm))
    return round(min(pitches), _SIZE_DECIMALS)


def _largest_pitch(corner: Points, border: Points, limit_mm: float) -> float:
    """The pitch in mm at which the extent of ``pitch * corner + border`` equals the limit.

    The extent is convex and piecewise linear in the pitch, so Newton's method ends on the exact piece.
    """
    pitch = limit_mm / float(np.ptp(corner))
    for _ in range(100):
        position = pitch * corner + border
        high, low = int(position.argmax()), int(position.argmin())
        slope, offset = corner[high] - corner[low], border[high] - border[low]
        next_pitch = float((limit_mm - offset) / slope)
        if next_pitch >= pitch * (1 - 1e-15):
            break
        pitch = next_pitch
    return pitch


def _make_shape(design: Design, layers: int) -> PatternShape:
    options = registered_patterns()[design.pattern].options
    spacing = (design.spacing or "angle") if "spacing" in options else "angle"
    if "aspect" not in options:
        return PatternShape(layers, spacing=spacing)
    if design.aspect is None and design.width_mm is not None and design.height_mm is not None:
        return PatternShape(layers, _filling_aspect(design, layers, spacing), spacing)
    return PatternShape(layers, DEFAULT_ASPECT if design.aspect is None else design.aspect, spacing)


def _filling_aspect(design: Design, layers: int, spacing: str) -> float:
    """The aspect at which a pattern fills both the width and the height, by bisection."""
    if design.rotation_deg % 180 != 0:
        raise DesignError(
            f"with rotation_deg = {design.rotation_deg:g} the aspect does not follow from width_mm and "
            "height_mm; add aspect"
        )

    def is_too_tall(aspect: float) -> bool:
        shape = PatternShape(layers, aspect, spacing)
        by_width = design.model_copy(update={"height_mm": None})
        by_height = design.model_copy(update={"width_mm": None})
        return fitting_pitch_mm(by_height, shape) < fitting_pitch_mm(by_width, shape)

    low, high = ASPECT_MIN, ASPECT_MAX
    if is_too_tall(low) or not is_too_tall(high):
        raise DesignError(
            f"no ellipse with an aspect of {ASPECT_MIN:g} to {ASPECT_MAX:g} fills {design.width_mm:g} x "
            f"{design.height_mm:g} mm less the border; change the sizes, or add aspect to stay within them"
        )
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if is_too_tall(middle) else (middle, high)
    return round((low + high) / 2, _SIZE_DECIMALS)


def _fitting_layers(design: Design) -> int:
    """The most layers that fit the overall size, or the fewest that cover the clip outline."""
    if design.width_mm is None and design.height_mm is None:
        return _covering_layers(design)

    def fits(layers: int) -> bool:
        # A tolerance of one picometre: 1.5 mm * 10 layers must fit into 30 mm.
        return bool(
            fitting_pitch_mm(design, _make_shape(design, layers))
            >= _require_given(design.pitch_mm) - 10**-DECIMALS
        )

    if not fits(1):
        raise DesignError(
            f"no layer of pitch_mm = {design.pitch_mm:g} mm fits the overall size; "
            f"the largest pitch that fits is {fitting_pitch_mm(design, _make_shape(design, 1)):.4g} mm"
        )
    return _largest_layers(fits)


def _covering_layers(design: Design) -> int:
    window = clip_outline(design, design.border_mm)

    def has_gap(layers: int) -> bool:
        corners = _require_given(design.pitch_mm) * rim_corners(design, _make_shape(design, layers))
        side = np.roll(corners, -1, axis=0) - corners
        to_window = window[:, None, :] - corners[None, :, :]
        return bool((side[:, 0] * to_window[..., 1] - side[:, 1] * to_window[..., 0]).min() < 0)

    layers = _largest_layers(has_gap) + 1 if has_gap(1) else 1
    if layers > MAX_LAYERS:
        raise DesignError(
            f"covering the clip outline with pitch_mm = {design.pitch_mm:g} mm takes more than {MAX_LAYERS} "
            "layers; make the pitch larger or the outline smaller"
        )
    return layers


def clip_outline(design: Design, inset_mm: float = 0.0) -> Points:
    """(K, 2) mm: the clip outline around the pattern's centre, every side moved inward by ``inset_mm``."""
    if design.clip == "circle":
        return circle_outline(_require_given(design.clip_diameter_mm) - 2 * inset_mm)
    return rectangle_outline(
        _require_given(design.clip_width_mm) - 2 * inset_mm,
        _require_given(design.clip_height_mm) - 2 * inset_mm,
    )


def _largest_layers(holds: Callable[[int], bool]) -> int:
    """The largest number of layers for which the condition holds, by bisection.

    The condition must hold for 1 and, from some number on, must fail for all larger ones.
    """
    low, high = 1, MAX_LAYERS + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _require_given(value: float | None) -> float:
    """A value whose presence ``Design`` has checked."""
    assert value is not None
    return value
