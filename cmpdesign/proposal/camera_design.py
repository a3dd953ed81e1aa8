"""The finest pattern that a camera reads on its field of view, with the error and the resolution of the pattern."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from html import escape
from typing import Any, NamedTuple, get_args

from cmpdesign.api.designs import Design
from cmpdesign.documents.designs import SizeDocument
from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.inputs.options import Make, pixels_of
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
LARGEST_VIEW_MM = 10_000.0
MAX_BLUR_PX, MAX_NOISE = 10.0, 50.0
_PITCH_DECIMALS = 4
_TWO_NUMBERS = r"\s*([0-9.]+)\s*[xX×]\s*([0-9.]+)\s*"


# Products whose pad is seen from behind: inside a sensor the camera looks at the pad's back, through gel or base layer.
# A print is looked at from its printed side, unless it is stuck to a gel.
SEEN_FROM_BEHIND: tuple[Make, ...] = ("laser", "mold")


class Sides(NamedTuple):
    """Width and height, in px or mm."""

    width: float
    height: float

    def __str__(self) -> str:
        return f"{self.width:g}x{self.height:g}"


class Proposal(SizeDocument):
    """A design for a camera, with what is predicted for the design; ``design.write("out")`` makes its files."""

    @property
    def refusal(self) -> str:
        """Why the product refuses a finer pattern; empty unless ``limit`` is "make"."""
        return str(self.found)

    def figures(self) -> dict[str, str]:
        """The key figures, in words."""
        design = self.design
        limits = {
            "pixels": f"{EDGE_WARNING_PX:g} px from marker to marker, the fewest that are read at every turn and tilt",
            "cells": f"cells with a circle of {CELL_WARNING_MM:g} mm inside, the smallest that are made well",
            "layers": f"{MAX_LAYERS} layers, the most",
            "error": "the error that was asked for",
            "make": f"what {self.make} makes: {self.refusal}",
        }
        side = "back: mirrored = true" if design.mirrored else "front: mirrored = false"
        return {
            "camera": f"{Sides(*self.camera_px)} px on {Sides(*self.view_mm)} mm: {self.scale_px_per_mm:.4g} px a mm",
            "field seen": "{:.4g} x {:.4g} mm".format(*self.seen_mm),
            "made by": self.make or "not stated; with --make laser, mold or print, build accepts the design",
            "side seen": f"the {side}; change this line if your camera sees the other side",
            "pattern": f"{design.pattern}, {design.layers} layers",
            "pitch": f"{design.pitch_mm:g} mm = {self.pitch_px:.3g} px",
            "markers": f"{self.markers}",
            "overall size": "{:.2f} x {:.2f} mm, border included".format(*design.layout.size_mm),
            "error per marker": f"{self.error_um:.3g} um per axis ({self.error_px:.4f} px), "
            f"{self.rim_error_um:.3g} um in the outermost layer",
            "told apart": f"objects {self.told_apart_mm:.3g} mm from each other, less what the soft layer spreads",
            "limited by": limits[self.limit],
        }

    def to_toml(self) -> str:
        """The design's TOML file, which ``build`` takes."""
        figures = self.figures()
        comments = [
            f"# {name}: {figures[name]}" for name in ("camera", "made by", "error per marker", "told apart")
        ]
        values = [f"{name} = {json.dumps(value)}" for name, value in self.model_dump()["design"].items()]
        return "\n".join([*comments, *values]) + "\n"

    def _repr_html_(self) -> str:
        """The key figures and the pattern, for notebooks."""
        cells = "".join(
            f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in self.figures().items()
        )
        return f"<div>{self.design.layout._repr_svg_().partition(chr(10))[2]}<table>{cells}</table></div>"


def propose(
    camera: str | Sequence[int],
    view: object,
    error: str | float | None,
    blur_px: float,
    noise: float,
    make: Make | None,
) -> Proposal:
    """The proposal of ``size``, whose arguments and errors these are."""
    pixels, seen_mm = Sides(*pixels_of("camera", camera)), _view_mm(view)
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
    predicted_px, um_per_px = predicted(layers), 1000 / scale
    only = f" --only {USUAL_NAMES},{make}" if make else ""
    return Proposal.of(
        refusal,
        camera_px=tuple(int(side) for side in pixels),
        view_mm=seen_mm,
        scale_px_per_mm=scale,
        design=design,
        markers=int(design.layout.present.sum()),
        pitch_px=design.pitch_mm * scale,
        error_px=predicted_px.inner_px,
        error_um=predicted_px.inner_px * um_per_px,
        rim_error_um=predicted_px.rim_px * um_per_px,
        # A triangular lattice resolves every longer period, and no shorter period in all directions. The blur by the
        # soft layer between objects and pattern is not included.
        told_apart_mm=PERIOD_PITCHES * design.pitch_mm,
        limit=limit,
        seen_mm=(pixels.width / scale, pixels.height / scale),
        make=make,
        next_command=f"cmpdesign build DESIGN.toml -o made{only}",
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


def _finest_layers(pixels: Sides, view_mm: Sides, scale: float) -> tuple[int, str]:
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
        raise CmpDesignError(f"{parameter('make', make)}: {FEWEST_LAYERS} layers on this view: {refusal}")
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
