"""Force, torque and regions of a contact from the displacement of the markers. It needs numpy and OpenCV, no CAD.

In: displacements in mm with covariances, a pad's Green's matrix (``Gel``), a modulus. Out: tractions, force, torque,
regions, each with its deviation, or a reason.
"""

from __future__ import annotations

from extractor.contact.gel import Gel, load_gel
from extractor.contact.reader import ContactReader, ForceModel
from extractor.contact.result import ContactForce, ContactReason, Region

__all__ = ["ContactForce", "ContactReader", "ContactReason", "ForceModel", "Gel", "Region", "load_gel"]
