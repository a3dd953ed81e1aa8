"""The finest pattern that a camera reads on its field of view, with the error and the resolution of the pattern."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any, Literal, NamedTuple, get_args

from cmpdesign.api.designs import Design
from cmpdesign.errors import CmpDesignError
from cmpdesign.layout.checks import CELL_WARNING_MM, EDGE_WARNING_PX
from cmpdesign.patterns.graphs import MAX_LAYERS
from cmpdesign.products.registry import USUAL_NAMES, refusal_of
from cmpdesign.proposal.predicted_error import Imaging, PredictedError, predict_error
from cmpdesign.units import LENGTHS_MM, parse_length_mm

# Width of the black border: twice the smallest width that `check` accepts, so that the pad need not be centred in the
# view.
BORDER_PITCHES = 0.5
# The white cell's third neighbour lies in layer 2.
FEWEST_LAYERS = 2
# Diameter of the circle inside a cell, and the longest period that the markers' lattice does not resolve, in pitches.
CELL_PITCHES, PERIOD_PITCHES = 1 / math.sqrt(3), math.sqrt(3)
LARGEST_SIDE_PX, LARGEST_VIEW_MM = 99_999, 10_000.0
MAX_BLUR_PX, MAX_NOISE = 10.0, 50.0
_PITCH_DECIMALS = 4
_TWO_NUMBERS = r"\s*([0-9.]+)\s*[xX×]\s*([0-9.]+)\s*"


Limit = Literal["pixels", "cells", "layers", "error", "make"]
Make = Literal["laser", "mold", "print"]
# Products whose pad is seen from behind: inside a sensor the camera looks at the pad's back, through gel or base layer.
# A print is looked at from its printed side, unless it is stuck to a gel.
SEEN_FROM_BEHIND: tuple[Make, ...] = ("laser", "mold")


class Sides(NamedTuple):
    """Width and height, in px or mm."""

    width: float
    height: float

    def __str__(self) -> str:
        return f"{self.width:g}x{self.height:g}"


@dataclass(frozen=True, eq=False)
class Proposal:
    """A design for a camera.

    Attributes:
        design: the design; ``design.write("out")`` makes its files.
        camera: width and height, px.
        view: width and height of the field of view in the pattern's plane, mm.
        scale_px_per_mm: pixels in a millimetre, by the tighter of the two sides.
        pitch_px: pixels from marker to marker.
        error: predicted standard deviation per marker and axis, px.
        limit: limit that a finer pattern would exceed, of ``Limit``; "cells" that can be made, "make" of the product.
        make: the product that makes the pad; None: not stated.
        refusal: why the product refuses a finer pattern; empty unless ``limit`` is "make".
    """

    design: Design
    camera: Sides
    view: Sides
    scale_px_per_mm: float
    pitch_px: float
    error: PredictedError
    limit: Limit
    make: Make | None = None
    refusal: str = ""

    @property
    def seen_mm(self) -> Sides:
        """Width and height of the field that all pixels see at this scale; one side is larger than the wanted view,
        where pixels and view differ in shape."""
        return Sides(self.camera.width / self.scale_px_per_mm, self.camera.height / self.scale_px_per_mm)

    @property
    def error_um(self) -> float:
        """Predicted standard deviation of an inner marker, per axis, um on the pattern."""
        return 1000 * self.error.inner_px / self.scale_px_per_mm

    @property
    def rim_error_um(self) -> float:
        """Predicted standard deviation of a marker of the outermost layer, per axis, um on the pattern."""
        return 1000 * self.error.rim_px / self.scale_px_per_mm

    @property
    def told_apart_mm(self) -> float:
        """Smallest distance at which two equal objects are told apart in any direction: a period of sqrt(3) pitches.

        A triangular lattice resolves every longer period, and no shorter period in all directions. The blur by the soft
        layer between objects and pattern is not included.
        """
        assert self.design.pitch_mm is not None
        return PERIOD_PITCHES * self.design.pitch_mm

    def figures(self) -> dict[str, str]:
        """The key figures, in words."""
        report, design = self.design.report, self.design
        limits = {
            "pixels": f"{EDGE_WARNING_PX:g} px from marker to marker, the fewest that are read at every turn and tilt",
            "cells": f"cells with a circle of {CELL_WARNING_MM:g} mm inside, the smallest that are made well",
            "layers": f"{MAX_LAYERS} layers, the most",
            "error": "the error that was asked for",
            "make": f"what {self.make} makes: {self.refusal}",
        }
        side = "back: mirrored = true" if design.mirrored else "front: mirrored = false"
        return {
            "camera": f"{self.camera} px on {self.view} mm: {self.scale_px_per_mm:.4g} px a mm",
            "field seen": "{:.4g} x {:.4g} mm".format(*self.seen_mm),
            "made by": self.make or "not stated; with --make laser, mold or print, build accepts the design",
            "side seen": f"the {side}; change this line if your camera sees the other side",
            "pattern": f"{design.pattern}, {design.layers} layers",
            "pitch": f"{design.pitch_mm:g} mm = {self.pitch_px:.3g} px",
            "markers": f"{report.present_markers}",
            "overall size": "{:.2f} x {:.2f} mm, border included".format(*report.size_mm),
            "error per marker": f"{self.error_um:.3g} um per axis ({self.error.inner_px:.4f} px), "
            f"{self.rim_error_um:.3g} um in the outermost layer",
            "told apart": f"objects {self.told_apart_mm:.3g} mm from each other, less what the soft layer spreads",
            "limited by": limits[self.limit],
        }

    def to_json(self) -> dict[str, Any]:
        """The proposal as a JSON object."""
        return {
            "format": "cmp-size",
            "version": 1,
            "camera_px": [int(side) for side in self.camera],
            "view_mm": list(self.view),
            "scale_px_per_mm": round(self.scale_px_per_mm, 4),
            "design": self._parameters(),
            "markers": self.design.report.present_markers,
            "pitch_px": round(self.pitch_px, 3),
            "error_px": round(self.error.inner_px, 5),
            "error_um": round(self.error_um, 4),
            "rim_error_um": round(self.rim_error_um, 4),
            "told_apart_mm": round(self.told_apart_mm, 4),
            "limit": self.limit,
            "seen_mm": [round(side, 4) for side in self.seen_mm],
            "make": self.make,
            "next_command": self.next_command("DESIGN.toml"),
        }

    def to_toml(self) -> str:
        """The design's TOML file, which ``build`` takes."""
        figures = self.figures()
        comments = [
            f"# {name}: {figures[name]}" for name in ("camera", "made by", "error per marker", "told apart")
        ]
        values = [f"{name} = {json.dumps(value)}" for name, value in self._parameters().items()]
        return "\n".join([*comments, *values]) + "\n"

    def next_command(self, path: str) -> str:
        """The command that makes the design of a TOML file."""
        only = f" --only {USUAL_NAMES},{self.make}" if self.make else ""
        return f"cmpdesign build {path} -o made{only}"

    def _parameters(self) -> dict[str, Any]:
        return {
            name: getattr(self.design, name) for name in _PARAMETERS if name in self.design.model_fields_set
        }

    def _repr_html_(self) -> str:
        """The key figures and the pattern, for notebooks."""
        cells = "".join(
            f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in self.figures().items()
        )
        return f"<div>{self.design.layout._repr_svg_().partition(chr(10))[2]}<table>{cells}</table></div>"


_PARAMETERS = (
    "description",
    "source",
    "pattern",
    "layers",
    "pitch_mm",
    "border_mm",
    "rotation_deg",
    "mirrored",
)


def size(
    camera: str | tuple[float, float],
    view: str | tuple[float, float],
    error: str | float | None = None,
    *,
    blur_px: float = 1.0,
    noise: float = 2.0,
    make: Make | None = None,
) -> Proposal:
    """Propose pitch and layers for a camera and its field of view, as the command ``size`` does.

    The pattern is the finest that fits the view and is read well: the error per marker grows with finer patterns, the
    distance at which objects are told apart falls. With ``error``, the pattern is the finest whose markers have this
    error.

    >>> proposal = cmpdesign.size("1280x960", "24x18mm", "0.2um")
    >>> proposal.design.write("out")

    Args:
        camera: pixels, width and height: (1280, 960) or "1280x960".
        view: width and height of the field of view in the pattern's plane: mm, or a text such as "24x18mm".
        error: largest standard deviation of an inner marker, per axis: mm, or a text such as "0.2um".
        blur_px: sigma of the Gaussian blur of optics and pixel together.
        noise: standard deviation of the camera's noise, in 255ths.
        make: product that makes the pad, "laser", "mold" or "print": the pattern is one that ``build`` accepts, and
            ``mirrored`` is the side that is usually seen. None: only the limits of the camera and of cells count.

    Raises:
        CmpDesignError: a value out of range, an error that the camera cannot reach, with the smallest error, or a view
            on which the product makes no pattern.
    """
    pixels, seen_mm = _pixels(camera), _view_mm(view)
    imaging = Imaging(
        _within("blur_px", blur_px, 0.3, MAX_BLUR_PX, "px"),
        _within("noise", noise, 0.1, MAX_NOISE, "of 255"),
    )
    if make is not None and make not in get_args(Make):
        raise CmpDesignError(f"make {make}: unknown; there are {', '.join(get_args(Make))}")
    scale = min(pixels.width / seen_mm.width, pixels.height / seen_mm.height)
    finest, limit = _finest_layers(pixels, seen_mm, scale)
    text = f"Proposed for {pixels} px on {seen_mm} mm."

    def design_of(layers: int) -> Design:
        fit = _fitting(layers, seen_mm)
        return Design(
            name="proposal",
            description=text,
            source="cmpdesign size",
            pattern="honeycomb",
            layers=layers,
            pitch_mm=fit.pitch_mm,
            border_mm=round(BORDER_PITCHES * fit.pitch_mm, _PITCH_DECIMALS),
            rotation_deg=fit.rotation_deg,
            **({"mirrored": True} if make in SEEN_FROM_BEHIND else {}),
        )

    def predicted(layers: int) -> PredictedError:
        return predict_error(round(_fitting(layers, seen_mm).pitch_mm * scale, 3), imaging)

    layers, refusal = _finest_made(make, finest, design_of) if make else (finest, "")
    if refusal:
        limit = "make"
    if error is not None:
        wanted_mm = _wanted_mm(error)
        if predicted(layers).inner_px / scale > wanted_mm:
            layers, limit = _coarser(wanted_mm * scale, layers, predicted), "error"
            if layers < FEWEST_LAYERS:
                raise CmpDesignError(
                    _unreachable(error, pixels, seen_mm, predicted(FEWEST_LAYERS).inner_px / scale)
                )
    design = design_of(layers)
    assert design.pitch_mm is not None
    return Proposal(
        design, pixels, seen_mm, scale, design.pitch_mm * scale, predicted(layers), limit, make, refusal
    )


class _Fit(NamedTuple):
    """The largest pitch, mm, at which a number of layers fits the view, and the turn of the pattern."""

    pitch_mm: float
    rotation_deg: float


def _fitting(layers: int, view_mm: Sides) -> _Fit:
    """The largest pitch at which a honeycomb of this number of layers fits the view with its border, lying or
    standing.
    """
    long = 2 * layers + 2 * BORDER_PITCHES / math.cos(math.radians(30))
    short = math.sqrt(3) * layers + 2 * BORDER_PITCHES
    lying = min(view_mm.width / long, view_mm.height / short)
    standing = min(view_mm.width / short, view_mm.height / long)
    step = 10.0**-_PITCH_DECIMALS
    pitch_mm = round(math.floor(max(lying, standing) / step) * step, _PITCH_DECIMALS)
    return _Fit(pitch_mm, 0.0 if lying >= standing else 90.0)


def _finest_layers(pixels: Sides, view_mm: Sides, scale: float) -> tuple[int, Limit]:
    """The largest number of layers that are read and made well, and the limit.

    Raises:
        CmpDesignError: the smallest number of layers is not.
    """
    smallest_mm = CELL_WARNING_MM / CELL_PITCHES
    pitch_mm = _fitting(FEWEST_LAYERS, view_mm).pitch_mm
    if pitch_mm * scale < EDGE_WARNING_PX:
        factor = EDGE_WARNING_PX / (pitch_mm * scale)
        needed = Sides(math.ceil(factor * pixels.width), math.ceil(factor * pixels.height))
        raise CmpDesignError(
            f"camera {pixels}: {FEWEST_LAYERS} layers on {view_mm} mm have {pitch_mm * scale:.3g} px from marker to "
            f"marker, limit {EDGE_WARNING_PX:g} px; use a camera of {needed} px or more"
        )
    if pitch_mm < smallest_mm:
        raise CmpDesignError(
            f"view {view_mm} mm: {FEWEST_LAYERS} layers have cells with a circle of {CELL_PITCHES * pitch_mm:.3g} mm "
            f"inside, limit {CELL_WARNING_MM:g} mm; give a view that is {smallest_mm / pitch_mm:.3g} times as large"
        )
    finest = FEWEST_LAYERS
    while finest < MAX_LAYERS:
        next_mm = _fitting(finest + 1, view_mm).pitch_mm
        if next_mm * scale < EDGE_WARNING_PX:
            return finest, "pixels"
        if next_mm < smallest_mm:
            return finest, "cells"
        finest += 1
    return finest, "layers"


def _finest_made(make: Make, finest: int, design_of: Callable[[int], Design]) -> tuple[int, str]:
    """The largest number of layers whose pad a product makes, and why it refuses one layer more ("" at ``finest``).

    Raises:
        CmpDesignError: the product makes no pad of the smallest number of layers.
    """
    refusal = refusal_of(make, design_of(finest))
    if not refusal:
        return finest, ""
    low, high = FEWEST_LAYERS - 1, finest
    while high - low > 1:
        middle = (low + high) // 2
        said = refusal_of(make, design_of(middle))
        low, high, refusal = (low, middle, said) if said else (middle, high, refusal)
    if low < FEWEST_LAYERS:
        raise CmpDesignError(f"--make {make}: {FEWEST_LAYERS} layers on this view: {refusal}")
    return low, refusal


def _coarser(wanted_px: float, finest: int, predicted: Any) -> int:
    """The largest number of layers whose predicted error is not above the wanted error; 1 if there is none."""
    low, high = FEWEST_LAYERS - 1, finest
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if predicted(middle).inner_px <= wanted_px else (low, middle)
    return low


def _unreachable(error: str | float, pixels: Sides, view_mm: Sides, best_mm: float) -> str:
    return (
        f"error {_shown_um(_wanted_mm(error))}: {pixels} px on {view_mm} mm allow no less than {_shown_um(best_mm)} "
        f"({FEWEST_LAYERS} layers); allow a larger error, or use more pixels, less noise or a smaller view"
    )


def _shown_um(mm: float) -> str:
    return f"{1000 * mm:.3g} um"


def _pixels(camera: object) -> Sides:
    match = re.fullmatch(_TWO_NUMBERS, camera) if isinstance(camera, str) else None
    sides = match.groups() if match else camera
    try:
        width, height = (int(side) for side in sides)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise CmpDesignError(f"camera {camera}: expected WIDTHxHEIGHT in px, as in 1280x960") from None
    for side in (width, height):
        _within("camera", side, 10, LARGEST_SIDE_PX, "px")
    return Sides(width, height)


def _view_mm(view: object) -> Sides:
    units = "|".join(LENGTHS_MM)
    match = re.fullmatch(_TWO_NUMBERS + rf"({units})?\s*", view) if isinstance(view, str) else None
    sides = [f"{number}{match[3] or 'mm'}" for number in match.groups()[:2]] if match else view
    try:
        width, height = (parse_length_mm(side) for side in sides)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise CmpDesignError(f"view {view}: expected WIDTHxHEIGHT with a unit, as in 24x18mm") from None
    for side in (width, height):
        _within("view", side, 0.01, LARGEST_VIEW_MM, "mm")
    return Sides(width, height)


def _wanted_mm(error: str | float) -> float:
    try:
        return _within("error", parse_length_mm(error), 1e-9, LARGEST_VIEW_MM, "mm")
    except CmpDesignError:
        raise
    except ValueError as problem:
        raise CmpDesignError(f"error {error}: {problem}") from None


def _within(name: str, value: float, low: float, high: float, unit: str) -> float:
    if not low <= value <= high:
        raise CmpDesignError(f"{name} is {value:g} {unit}; expected {low:g} to {high:g} {unit}")
    return float(value)
