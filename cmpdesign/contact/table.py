"""The [contact] table of a scene: the same names as in Python, checked, and lengths with units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.errors import ContactError
from cmpdesign.contact.heightmap import HeightMap
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects import Ball, Cube, Cylinder, Indenter, Punch, Rib, Ring, Wedge
from cmpdesign.contact.result import Contact
from cmpdesign.contact.solve import solve
from cmpdesign.quantities import Angle, Length, LengthOrZero
from cmpdesign.units import parse_length_mm


@dataclass(frozen=True)
class ContactSetup:
    """Everything that ``solve`` takes, ready to be solved, as it is or with another motion or place."""

    elastomer: Elastomer
    indenter: Indenter
    motion: Motion
    friction: float
    size_mm: tuple[float, float]
    grid: int
    steps: int

    def solve(self) -> Contact:
        """The contact.

        Raises:
            ContactError: the object misses the solved area, or the grid does not fit it.
        """
        return solve(
            self.elastomer,
            self.indenter,
            self.motion,
            friction=self.friction,
            size_mm=self.size_mm,
            grid=self.grid,
            steps=self.steps,
        )
