"""Contact of a rigid object with the elastic layer that carries the pattern.

In: an elastomer, an object, its motion. Out: displacement and traction of the surface.
"""

from __future__ import annotations

from cmpdesign.contact.continuation import ContinuedSurface, SurfaceContinuation
from cmpdesign.contact.elastomer import Elastomer
from cmpdesign.contact.errors import ContactError
from cmpdesign.contact.motion import Motion
from cmpdesign.contact.objects.heightmap import HeightMap
from cmpdesign.contact.objects.indenters import Ball, Cube, Cylinder, Indenter, Punch, Rib, Ring, Wedge
from cmpdesign.contact.result import Contact, Relief
from cmpdesign.contact.solve import solve, solve_path
from cmpdesign.contact.table import ContactSetup, contact_from

__all__ = [
    "Ball",
    "Contact",
    "ContactError",
    "ContactSetup",
    "ContinuedSurface",
    "Cube",
    "Cylinder",
    "Elastomer",
    "HeightMap",
    "Indenter",
    "Motion",
    "Punch",
    "Relief",
    "Rib",
    "Ring",
    "SurfaceContinuation",
    "Wedge",
    "contact_from",
    "solve",
    "solve_path",
]
