"""Options of ``reconstruct`` that concern the surface."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmpdesign.errors import CmpDesignError, parameter


@dataclass(frozen=True)
class ShapeOptions:
    """Options of ``reconstruct`` that concern the surface.

    Attributes:
        from_rest: place all views by the rest frame, also the views whose pose the rig gives.
        flatness_mm: standard deviation of the markers from the plane at rest.
        model_px: error of the camera model; None: from the rest frame.
        surface: also give the touched surface, by the [elastomer] of the rig.
        contact: file of the pad's gel (``calibrate gel``); also give force, torque and traction, by the Young's modulus
            of the rig's [elastomer]; None: not wanted.

    Raises:
        CmpDesignError: a length that is negative or not finite.
    """

    from_rest: bool = False
    flatness_mm: float = 0.0
    model_px: float | None = None
    surface: bool = False
    contact: Path | None = None

    def __post_init__(self) -> None:
        for name in ("flatness_mm", "model_px"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < float("inf"):
                raise CmpDesignError(f"{parameter(name)} is {value:g}; expected a number from 0")
